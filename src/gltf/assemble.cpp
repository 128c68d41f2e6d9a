// Quads and triangles of a surface into the vertices of its primitives.
#include "assemble.hpp"

#include <algorithm>
#include <map>
#include <numeric>

#include "normals.hpp"
#include "regions.hpp"

namespace quadrig::gltf {
namespace {

/// A row's strongest weights, rescaled.
std::vector<std::pair<Index, double>> strongest(const SkinWeights& weights, Index row, Index influences) {
  std::vector<BoneShare> shares;
  for (SkinWeights::InnerIterator it(weights, row); it; ++it)
    shares.push_back({static_cast<Index>(it.col()), it.value()});
  (void)keep_strongest(shares, influences);
  std::vector<std::pair<Index, double>> own;
  for (const BoneShare& share : shares) own.emplace_back(share.bone, share.weight);
  return own;
}

/// Where a point of the prepared surface lies on the input: primitive, triangle, and the second and third of its
/// barycentric coordinates there.
Eigen::Vector4d source_of(const Job& job, Index face, const Vector3& p) {
  const Gathered& gathered = job.gathered;
  const Index t = gathered.source_triangle[at(face)];
  Vector3 corner[3];
  for (int i = 0; i < 3; ++i) corner[i] = gathered.positions.row(gathered.triangles(t, i)).transpose();
  const SurfaceHit hit = closest_on_triangle(p, corner[0], corner[1], corner[2]);
  return {static_cast<double>(job.primitive_number[at(gathered.triangle_primitive[at(t)])]),
          static_cast<double>(gathered.triangle_number[at(t)]), hit.barycentric[1], hit.barycentric[2]};
}

/// How the normals change with each morph target that has normals: as those of the quads' faces do.
struct MorphNormals {
  std::vector<std::pair<Eigen::Index, Points<double>>> changes;  ///< first column, one row a normal

  MorphNormals(const Gathered& gathered, const RemeshResult& result, const FieldNormals& normals) {
    const Points<double> resting = normals.anew(result.mesh.positions);
    for (const Attribute& attribute : gathered.attributes) {
      if (attribute.target == Attribute::no_target || attribute.name != "NORMAL") continue;
      Points<double> moved = result.mesh.positions;
      std::size_t morph = 0;
      for (const Attribute& other : gathered.attributes) {
        if (other.target == Attribute::no_target || other.name != "POSITION") continue;
        if (other.target == attribute.target) moved += result.morphs[morph];
        ++morph;
      }
      changes.emplace_back(attribute.first, normals.anew(moved) - resting);
    }
  }
  void put(Index normal, Eigen::VectorXd& values) const {
    for (const auto& [first, change] : changes) values.segment<3>(first) = change.row(normal).transpose();
  }
};

/// What each morph target does to the position of a vertex, as the fit has it: once a vertex, whatever the side of a
/// seam, so that vertices doubled there move as one.
class MorphPositions {
 public:
  MorphPositions(const Job& job, const RemeshResult& result) : morphs_(result.morphs) {
    for (const Attribute& a : job.gathered.attributes)
      if (a.target != Attribute::no_target && a.name == "POSITION") columns_.push_back(a.first);
  }
  /// \param values what the vertex has in a primitive; their displacements are set
  void put(Index v, Eigen::VectorXd& values) const {
    for (std::size_t k = 0; k < columns_.size(); ++k) values.segment<3>(columns_[k]) = morphs_[k].row(v).transpose();
  }

 private:
  const std::vector<Points<double>>& morphs_;
  std::vector<Eigen::Index> columns_;
};

}  // namespace

void add_field(Job& job, const Shells& shells, const RemeshResult& result, const std::map<Index, Index>& claims,
               const std::vector<char>& keep_normals, Index influences) {
  const QuadMesh& quads = result.mesh;
  if (quads.quad_count() == 0) return;
  std::vector<Index> every(at(job.gathered.surface.asset.mesh.face_count()));
  std::iota(every.begin(), every.end(), 0);
  Regions regions(job.gathered, job.gathered.surface.asset.mesh, every);
  for (const auto& [quad, face] : claims) regions.claim(quad, face);
  const FieldNormals normals(job.gathered, *shells.wedges, shells.components, quads, keep_normals);
  const MorphNormals morphs(job.gathered, result, normals);
  const MorphPositions displacements(job, result);
  // Values that a vertex has with one normal in a primitive: more than one where a seam runs through it.
  std::map<std::pair<Index, Index>, std::vector<Eigen::VectorXd>> variants;
  for (Index q = 0; q < quads.quad_count(); ++q) {
    const Regions::QuadValues values = regions.of_quad(quads, q);
    PrimitiveBuilder& builder = job.builders[at(values.primitive)];
    builder.needs_normals();
    std::array<Index, 4> corner{};
    for (int i = 0; i < 4; ++i) {  // the first corner is that of the better diagonal: the fit chose it
      const Index v = quads.quads(q, i);
      const Eigen::VectorXd& own = values.corners[static_cast<std::size_t>(i)];
      const Index normal = normals.of_corner(q, i);
      std::vector<Eigen::VectorXd>& known = variants[{values.primitive, normal}];
      std::size_t variant = 0;
      while (variant < known.size() && !regions.alike(known[variant], own)) ++variant;
      if (variant == known.size()) known.push_back(own);
      const std::uint64_t key = static_cast<std::uint64_t>(variant) << 32 | static_cast<std::uint32_t>(normal);
      corner[static_cast<std::size_t>(i)] = builder.vertex(key, [&] {
        const Vector3 p = quads.positions.row(v).transpose();
        PrimitiveBuilder::Vertex made{p, normals.normal(normal), own, {}, {}};
        displacements.put(v, made.values);
        morphs.put(normal, made.values);
        made.source = source_of(job, quads.source[at(v)].face, p);
        if (result.weights) made.weights = strongest(*result.weights, v, influences);
        return made;
      });
    }
    builder.quad(corner[0], corner[1], corner[2], corner[3]);
  }
}

void add_polygons(Job& job, const Shells& shells, const Shell& shell, bool quads, GltfNormals normals,
                  Index influences) {
  const Gathered& gathered = job.gathered;
  const Asset& asset = gathered.surface.asset;
  const TriangleMesh<double>& mesh = asset.mesh;
  const auto point = [&](Index v) { return mesh.position(v); };
  const bool flat = shells.wedges->flat(shells.components.of_face[at(shell.faces.front())]);
  const auto normal_of = [&](const Polygon& p) {
    return p.size() == 4
               ? Vector3((point(p.vertex[2]) - point(p.vertex[0])).cross(point(p.vertex[3]) - point(p.vertex[1])))
               : Vector3((point(p.vertex[1]) - point(p.vertex[0])).cross(point(p.vertex[2]) - point(p.vertex[0])));
  };
  const auto unit = [](const Vector3& n) {
    const double length = n.norm();
    return length > 0 && std::isfinite(length) ? Vector3(n / length) : Vector3::UnitZ();
  };
  // At each vertex the normals of its polygons, with those that the file has there.
  std::map<Index, std::vector<std::pair<std::optional<Vector3>, Vector3>>> around;
  for (const Polygon& p : shell.polygons)
    for (std::size_t i = 0; i < p.size(); ++i)
      around[p.vertex[i]].emplace_back(shells.wedges->normal(p.wedge[i], p.primitive), normal_of(p));
  const auto smooth = [&](Index v, const std::optional<Vector3>& own) {
    Vector3 sum = Vector3::Zero();
    for (const auto& [theirs, n] : around.at(v))
      if (!own || !theirs || own->dot(*theirs) > hard_cosine) sum += n;
    return unit(sum);
  };
  for (const Polygon& polygon : shell.polygons) {
    if ((polygon.size() == 4) != quads) continue;
    PrimitiveBuilder& builder = job.builders[at(polygon.primitive)];
    std::array<Index, 4> corner{};
    std::size_t first = 0;
    if (quads && shell.make != GltfMake::kept)
      first = static_cast<std::size_t>(first_corner(
          {point(polygon.vertex[0]), point(polygon.vertex[1]), point(polygon.vertex[2]), point(polygon.vertex[3])}));
    const bool kept = shell.make == GltfMake::kept;
    const bool has_normals = shells.wedges->normal(polygon.wedge[0], polygon.primitive).has_value();
    if (!kept || has_normals || normals == GltfNormals::fresh) builder.needs_normals();
    const std::uint64_t apart = flat && !(kept && has_normals) ? ++job.flat_faces : 0;
    const auto vertex = [&](std::size_t i, Index wedge) {
      const Index v = polygon.vertex[i];
      // Keys of a field's quads are small; these begin at 2^62 and, where each face has its own, at 2^63.
      const std::uint64_t key =
          apart > 0 ? std::uint64_t{1} << 63 | apart << 2 | i
                    : std::uint64_t{1} << 62 | static_cast<std::uint64_t>(v) << 31 | static_cast<std::uint64_t>(wedge);
      return builder.vertex(key, [&] {
        const Index h = mesh.outgoing(v);
        PrimitiveBuilder::Vertex made{
            point(v), Vector3::Zero(), gathered.values.row(wedge).transpose(), {}, source_of(job, h / 3, point(v))};
        if (const auto moved = shell.moved.find(v); moved != shell.moved.end()) {
          made.position += moved->second[0];
          std::size_t target = 0;
          for (const Attribute& a : gathered.attributes)
            if (a.target != Attribute::no_target && a.name == "POSITION")
              made.values.segment<3>(a.first) += moved->second[++target];
        }
        if (asset.rig) made.weights = strongest(asset.rig->weights, v, influences);
        const std::optional<Vector3> own = shells.wedges->normal(wedge, polygon.primitive);
        const bool files = own && (kept || (!flat && normals != GltfNormals::fresh));
        made.normal = files ? *own : flat ? unit(normal_of(polygon)) : smooth(v, own);
        return made;
      });
    };
    if (kept) {
      // As the file has them: the halves of a quad share no vertices where they did not.
      const auto triangle = [&](std::size_t t, std::size_t b, std::size_t c) {
        const Index i = vertex(0, polygon.own[t][0]), j = vertex(b, polygon.own[t][1]),
                    k = vertex(c, polygon.own[t][2]);
        return std::array{i, j, k};
      };
      const auto one = triangle(0, 1, 2);
      if (quads)
        builder.quad(one, triangle(1, 2, 3));
      else
        builder.triangle(one[0], one[1], one[2]);
      continue;
    }
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      const std::size_t i = (first + k) % polygon.size();
      corner[k] = vertex(i, polygon.wedge[i]);
    }
    quads ? builder.quad(corner[0], corner[1], corner[2], corner[3])
          : builder.triangle(corner[0], corner[1], corner[2]);
  }
}

}  // namespace quadrig::gltf
