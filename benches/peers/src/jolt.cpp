// Jolt's broad phase behind four C functions; see jolt.rs.

#include <Jolt/Jolt.h>

#include <Jolt/Core/Memory.h>
#include <Jolt/Physics/Body/BodyCreationSettings.h>
#include <Jolt/Physics/Body/BodyManager.h>
#include <Jolt/Physics/Body/BodyPair.h>
#include <Jolt/Physics/Collision/BroadPhase/BroadPhaseQuadTree.h>
#include <Jolt/Physics/Collision/Shape/SphereShape.h>
#include <Jolt/RegisterTypes.h>

#include <cstdint>
#include <vector>

namespace {

struct Box {
    float low[3];
    float high[3];
};

struct OneLayer final : JPH::BroadPhaseLayerInterface {
    JPH::uint GetNumBroadPhaseLayers() const override { return 1; }
    JPH::BroadPhaseLayer GetBroadPhaseLayer(JPH::ObjectLayer) const override { return JPH::BroadPhaseLayer(0); }
    const char *GetBroadPhaseLayerName(JPH::BroadPhaseLayer) const override { return "all"; }
};

struct Found final : JPH::BodyPairCollector {
    std::vector<uint32_t> pairs;

    void AddHit(const JPH::BodyPair &pair) override {
        pairs.push_back(pair.mBodyA.GetIndex());
        pairs.push_back(pair.mBodyB.GetIndex());
    }
};

using Ids = std::vector<JPH::BodyID>;

struct Broad {
    OneLayer layers;
    JPH::BodyManager bodies;
    JPH::BroadPhaseQuadTree tree;
    Ids all;
    Ids moved;
    Ids churned;
    // Those who are active; the tree sorts what it is given, so this is no copy of the lists above.
    Ids asked;
    Found found;

    // Jolt takes boxes from shapes and poses, which round; the place where it keeps them takes ours as they are.
    void write(JPH::BodyID id, const Box &box) {
        JPH::AABox &bounds = const_cast<JPH::AABox &>(bodies.GetBody(id).GetWorldSpaceBounds());
        bounds.mMin = JPH::Vec3(box.low[0], box.low[1], box.low[2]);
        bounds.mMax = JPH::Vec3(box.high[0], box.high[1], box.high[2]);
    }

    void insert(Ids &ids) {
        const int count = int(ids.size());
        tree.AddBodiesFinalize(ids.data(), count, tree.AddBodiesPrepare(ids.data(), count));
    }
};

} // namespace

extern "C" {

// Null when this was not compiled as Jolt was.
Broad *jolt_new(uint32_t count) {
    if (!JPH::VerifyJoltVersionID())
        return nullptr;
    JPH::RegisterDefaultAllocator();
    Broad *self = new Broad;
    self->bodies.Init(count, 0, self->layers);
    self->tree.Init(&self->bodies, self->layers);
    JPH::RefConst<JPH::Shape> shape = new JPH::SphereShape(0.5f);
    JPH::BodyCreationSettings settings(shape, JPH::RVec3::sZero(), JPH::Quat::sIdentity(), JPH::EMotionType::Dynamic,
                                       0);
    for (uint32_t i = 0; i < count; i++) {
        JPH::Body *body = self->bodies.AllocateBody(settings);
        self->bodies.AddBody(body);
        self->all.push_back(body->GetID());
    }
    return self;
}

// What is not timed: new boxes, and who is active. Only those who are active are asked for their pairs.
void jolt_take(Broad *self, const Box *boxes, const uint32_t *churned, size_t churned_count, const uint32_t *moved,
               size_t moved_count, bool everybody) {
    self->churned.clear();
    self->moved.clear();
    for (size_t i = 0; i < churned_count; i++)
        self->churned.push_back(self->all[churned[i]]);
    for (size_t i = 0; i < moved_count; i++)
        self->moved.push_back(self->all[moved[i]]);
    Ids asked = self->churned;
    asked.insert(asked.end(), self->moved.begin(), self->moved.end());
    for (JPH::BodyID id : asked)
        self->write(id, boxes[id.GetIndex()]);
    if (everybody)
        asked = self->all;
    self->bodies.DeactivateBodies(self->asked.data(), int(self->asked.size()));
    self->bodies.ActivateBodies(asked.data(), int(asked.size()));
    self->asked = asked;
}

// The first of all steps: what moved is what there is.
void jolt_insert(Broad *self) {
    self->insert(self->moved);
    self->moved.clear();
    self->tree.Optimize();
}

void jolt_step(Broad *self) {
    if (!self->churned.empty()) {
        self->tree.RemoveBodies(self->churned.data(), int(self->churned.size()));
        self->insert(self->churned);
    }
    if (!self->moved.empty())
        self->tree.NotifyBodiesAABBChanged(self->moved.data(), int(self->moved.size()), true);
    self->tree.FrameSync();
    self->tree.LockModifications();
    JPH::BroadPhase::UpdateState update = self->tree.UpdatePrepare();
    self->tree.UpdateFinalize(update);
    self->tree.UnlockModifications();
    self->found.pairs.clear();
    const JPH::ObjectVsBroadPhaseLayerFilter layers;
    const JPH::ObjectLayerPairFilter pairs;
    if (!self->asked.empty())
        self->tree.FindCollidingPairs(self->asked.data(), int(self->asked.size()), 0.0f, layers, pairs, self->found);
}

// Two numbers a pair.
const uint32_t *jolt_pairs(Broad *self, size_t *count) {
    *count = self->found.pairs.size();
    return self->found.pairs.data();
}

} // extern "C"
