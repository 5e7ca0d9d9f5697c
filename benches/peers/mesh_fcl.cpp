// FCL's mesh pairs to the end, cold, called from C++: python-fcl builds a Python object and four numpy arrays for each
// contact within the timed call, so that its contact sets are not a timing of FCL. `benches/mesh_peers.py` builds this,
// templates and all for the machine's own processor, and starts it once a round:  mesh_fcl FOLDER
//
// In, from that folder: the meshes and poses that `time_critical -- peers` wrote, and `jobs.txt`, a line `pair job` for
// each question. Out: `fcl.csv`, in the columns of `rust.csv`.
//
// Boxes: OBBRSS, the ones of python-fcl, and beside them the lighter kinds alone, OBB for collide and RSS for distance
// (FCL has no distance of OBB), that FCL be seen at its fastest. Requests are those of python-fcl's defaults.

#include <fcl/fcl.h>

#include <ctime>

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using Place = fcl::Transform3<double>;
using Places = fcl::aligned_vector<Place>;

// As many as python-fcl is allowed: no pair here comes near it.
const std::size_t contacts_max = 100000;
const std::size_t meshes = 4;

struct Mesh {
    std::vector<fcl::Vector3<double>> vertices;
    std::vector<fcl::Triangle> faces;
};

struct Job {
    std::size_t pair;
    std::string name;
};

struct Found {
    std::int64_t ns;
    bool touches;
    double distance_m;
    std::size_t contacts;
};

template <typename T>
T take(std::istream &in) {
    T value;
    if (!in.read(reinterpret_cast<char *>(&value), sizeof value)) {
        throw std::runtime_error("a mesh or the poses end too soon");
    }
    return value;
}

std::ifstream opened(const std::string &path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) {
        throw std::runtime_error("cannot read " + path);
    }
    return in;
}

// Two counts, then vertices as f64 and faces as u32, little-endian as the machine is.
Mesh read_mesh(const std::string &path) {
    std::ifstream in = opened(path);
    const auto vertices = take<std::uint32_t>(in);
    const auto faces = take<std::uint32_t>(in);
    Mesh mesh;
    for (std::uint32_t k = 0; k < vertices; ++k) {
        const auto v = take<std::array<double, 3>>(in);
        mesh.vertices.emplace_back(v[0], v[1], v[2]);
    }
    for (std::uint32_t k = 0; k < faces; ++k) {
        const auto corners = take<std::array<std::uint32_t, 3>>(in);
        mesh.faces.emplace_back(corners[0], corners[1], corners[2]);
    }
    return mesh;
}

// Place and quaternion, x y z w, two to a pair.
Places read_places(const std::string &path) {
    std::ifstream in = opened(path);
    Places places;
    while (in.peek() != std::ifstream::traits_type::eof()) {
        const auto p = take<std::array<double, 7>>(in);
        Place place = Place::Identity();
        place.translation() = fcl::Vector3<double>(p[0], p[1], p[2]);
        place.linear() = fcl::Quaternion<double>(p[6], p[3], p[4], p[5]).normalized().toRotationMatrix();
        places.push_back(place);
    }
    return places;
}

std::vector<Job> read_jobs(const std::string &path, std::size_t pairs) {
    std::ifstream in = opened(path);
    std::vector<Job> jobs;
    for (Job job; in >> job.pair >> job.name;) {
        const bool known = job.name == "verdict" || job.name == "distance" || job.name == "contacts";
        if (!known || job.pair >= pairs) {
            throw std::runtime_error("no such job: " + std::to_string(job.pair) + " " + job.name);
        }
        jobs.push_back(job);
    }
    return jobs;
}

std::int64_t thread_cpu_ns() {
    timespec now;
    if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) != 0) {
        throw std::runtime_error("no clock of the thread's CPU time");
    }
    return std::int64_t(now.tv_sec) * 1000000000 + now.tv_nsec;
}

template <typename Box>
using Model = std::unique_ptr<fcl::BVHModel<Box>>;

template <typename Box>
Model<Box> build(const Mesh &mesh) {
    Model<Box> model(new fcl::BVHModel<Box>());
    bool good = model->beginModel(int(mesh.faces.size()), int(mesh.vertices.size())) == fcl::BVH_OK;
    good = good && model->addSubModel(mesh.vertices, mesh.faces) == fcl::BVH_OK;
    good = good && model->endModel() == fcl::BVH_OK;
    if (!good) {
        throw std::runtime_error("FCL takes no such mesh");
    }
    return model;
}

// One way of FCL's: which boxes answer collide and which distance.
template <typename CollideBox, typename DistanceBox>
class Library {
public:
    explicit Library(const std::vector<Mesh> &shapes) : first(1, false), all(contacts_max, true) {
        for (const Mesh &shape : shapes) {
            to_collide.push_back(build<CollideBox>(shape));
            to_measure.push_back(build<DistanceBox>(shape));
        }
    }

    Found ask(const Job &job, const Places &places) {
        const std::size_t x = job.pair % meshes;
        const std::size_t y = (job.pair + 1) % meshes;
        const Place &here = places[2 * job.pair];
        const Place &there = places[2 * job.pair + 1];
        if (job.name == "distance") {
            fcl::DistanceResult<double> result;
            const std::int64_t from_ns = thread_cpu_ns();
            fcl::distance(to_measure[x].get(), here, to_measure[y].get(), there, nearest, result);
            const std::int64_t ns = thread_cpu_ns() - from_ns;
            return {ns, result.min_distance <= 0.0, result.min_distance, 0};
        }
        const fcl::CollisionRequest<double> &request = job.name == "verdict" ? first : all;
        // Emptied, not made anew: ours writes to memory of earlier questions too.
        contacts.clear();
        const std::int64_t from_ns = thread_cpu_ns();
        fcl::collide(to_collide[x].get(), here, to_collide[y].get(), there, request, contacts);
        const std::int64_t ns = thread_cpu_ns() - from_ns;
        const double none = std::numeric_limits<double>::quiet_NaN();
        return {ns, contacts.isCollision(), none, contacts.numContacts()};
    }

private:
    std::vector<Model<CollideBox>> to_collide;
    std::vector<Model<DistanceBox>> to_measure;
    fcl::CollisionRequest<double> first;
    fcl::CollisionRequest<double> all;
    fcl::DistanceRequest<double> nearest;
    fcl::CollisionResult<double> contacts;
};

template <typename CollideBox, typename DistanceBox>
void run(const char *name, const std::vector<Mesh> &shapes, const Places &places, const std::vector<Job> &jobs,
         std::ostream &csv) {
    Library<CollideBox, DistanceBox> library(shapes);
    // Once round without a row: memory and caches are then as the others have them.
    for (const Job &job : jobs) {
        library.ask(job, places);
    }
    for (const Job &job : jobs) {
        const Found found = library.ask(job, places);
        csv << job.pair << ',' << name << ',' << job.name << ',' << found.ns << ',' << int(found.touches) << ','
            << found.distance_m << ',' << found.distance_m << ',' << found.contacts << '\n';
    }
}

void run_all(const std::string &folder) {
    std::vector<Mesh> shapes;
    for (std::size_t k = 0; k < meshes; ++k) {
        shapes.push_back(read_mesh(folder + "/mesh" + std::to_string(k) + ".bin"));
    }
    const Places places = read_places(folder + "/poses.bin");
    const std::vector<Job> jobs = read_jobs(folder + "/jobs.txt", places.size() / 2);
    std::ofstream csv(folder + "/fcl.csv");
    csv.precision(17);
    csv << "pair,library,job,ns,touches,gap_min_m,gap_max_m,contacts\n";
    run<fcl::OBBRSS<double>, fcl::OBBRSS<double>>("fcl-cpp " FCL_VERSION, shapes, places, jobs, csv);
    run<fcl::OBB<double>, fcl::RSS<double>>("fcl-cpp " FCL_VERSION " OBB/RSS", shapes, places, jobs, csv);
    if (!csv.flush()) {
        throw std::runtime_error("cannot write " + folder + "/fcl.csv");
    }
}

} // namespace

int main(int count, char **words) {
    if (count != 2) {
        std::cerr << "mesh_fcl FOLDER\n";
        return 2;
    }
    try {
        run_all(words[1]);
    } catch (const std::exception &error) {
        std::cerr << "mesh_fcl: " << error.what() << '\n';
        return 1;
    }
    return 0;
}
