// Bullet's broad phases behind five C functions; see bullet.rs.

#include <BulletCollision/BroadphaseCollision/btAxisSweep3.h>
#include <BulletCollision/BroadphaseCollision/btDbvtBroadphase.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace {

struct Box {
    float low[3];
    float high[3];
};

btVector3 vector(const float *v) { return btVector3(v[0], v[1], v[2]); }

struct Broad {
    btBroadphaseInterface *broad;
    std::vector<btBroadphaseProxy *> proxies;

    void put(uint32_t body, const Box &box) {
        // The body's number is kept as the owner, which nothing here reads as an address.
        void *owner = reinterpret_cast<void *>(static_cast<uintptr_t>(body));
        const int all = btBroadphaseProxy::AllFilter;
        proxies[body] = broad->createProxy(vector(box.low), vector(box.high), 0, owner, all, all, nullptr);
    }
};

uint32_t body_of(const btBroadphaseProxy *proxy) {
    return static_cast<uint32_t>(reinterpret_cast<uintptr_t>(proxy->m_clientObject));
}

} // namespace

extern "C" {

// sweep: the 32-bit axis sweep over `world`; otherwise the two trees. Its own tree for rays is left out.
Broad *bullet_new(bool sweep, uint32_t bodies, const Box *world) {
    btBroadphaseInterface *broad;
    if (sweep)
        broad = new bt32BitAxisSweep3(vector(world->low), vector(world->high), bodies + 1, nullptr, true);
    else
        broad = new btDbvtBroadphase();
    return new Broad{broad, std::vector<btBroadphaseProxy *>(bodies, nullptr)};
}

void bullet_put(Broad *self, const Box *boxes, const uint32_t *bodies, size_t count) {
    for (size_t i = 0; i < count; i++)
        self->put(bodies[i], boxes[bodies[i]]);
}

void bullet_step(Broad *self, const Box *boxes, const uint32_t *churned, size_t churned_count, const uint32_t *moved,
                 size_t moved_count) {
    for (size_t i = 0; i < churned_count; i++) {
        self->broad->destroyProxy(self->proxies[churned[i]], nullptr);
        self->put(churned[i], boxes[churned[i]]);
    }
    for (size_t i = 0; i < moved_count; i++) {
        const Box &box = boxes[moved[i]];
        self->broad->setAabb(self->proxies[moved[i]], vector(box.low), vector(box.high), nullptr);
    }
    self->broad->calculateOverlappingPairs(nullptr);
}

size_t bullet_pair_count(Broad *self) {
    return static_cast<size_t>(self->broad->getOverlappingPairCache()->getNumOverlappingPairs());
}

void bullet_pairs(Broad *self, uint32_t (*pairs)[2]) {
    const btBroadphasePairArray &all = self->broad->getOverlappingPairCache()->getOverlappingPairArray();
    for (int i = 0; i < all.size(); i++) {
        pairs[i][0] = body_of(all[i].m_pProxy0);
        pairs[i][1] = body_of(all[i].m_pProxy1);
    }
}

} // extern "C"
