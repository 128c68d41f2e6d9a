// What hinges ask of directions and sizes. The middle of each pulls at directions: lines run round the limb there, and
// poles lie elsewhere. One whose loops are asked for by name gets the rows that they need.
#pragma once

#include "quadrig/constraints/hinges.hpp"
#include "quadrig/pipeline.hpp"

namespace quadrig::detail {

/// Of the steps of a curve, weighted by length, the part along a direction.
[[nodiscard]] inline double share_along(const TriangleMesh<double>& mesh, const FaceLoop& loop, const Vector3& along) {
  double sum = 0, length = 0;
  for (std::size_t k = 0; k < loop.crossed.size(); ++k) {
    const Vector3 step = crossing(mesh, loop, (k + 1) % loop.crossed.size()) - crossing(mesh, loop, k);
    sum += std::abs(step.dot(along));
    length += step.norm();
  }
  return length > 0 ? sum / length : 1;
}

/// Directions round each hinge in the middle of its bend. Not where the curve runs along the bones, as that of a
/// clavicle does on a chest: there lines round it would force poles. Nor where few quads go around: the lines of short
/// loops need all the freedom that they have.
/// \param edge of a quad along a loop
/// On three characters at seven counts, hinges with three loops within the bend: 99 for 76, with as many poles.
inline void pull_along_hinges(const TriangleMesh<double>& mesh, const Rig& rig, const LoopOptions& loops,
                              function_ref<double(const FaceLoop&)> edge, std::vector<FaceDirection>& all) {
  constexpr double weight = 2;         // a bone pulls by 1
  constexpr double middle = 0.5;       // of the bend
  constexpr double most_along = 0.3;   // a circle's share along a direction in its plane is 2/π
  constexpr double least_around = 14;  // quads
  const std::vector<Bone>& bones = rig.skeleton.bones;
  std::vector<std::size_t> from(at(mesh.vertex_count()), 0);
  std::vector<char> near(from.size(), 0);
  for (const Hinge& hinge : find_hinges(mesh, rig)) {
    const Bone &bone = bones[at(hinge.bone)], &parent = bones[at(bone.parent)];
    if (loops.of(bone.name) == 0 || hinge.length < least_around * edge(hinge.loop)) continue;
    if (std::min(share_along(mesh, hinge.loop, bone.direction()), share_along(mesh, hinge.loop, parent.direction())) >
        most_along)
      continue;
    const std::vector<BesideLoop> beside = vertices_beside(mesh, hinge.loop, middle * hinge.bend);
    for (const BesideLoop& one : beside) {
      near[at(one.vertex)] = 1;
      from[at(one.vertex)] = one.crossing;
    }
    // Chords of an eighth of the curve, which from triangle to triangle is a saw.
    const std::size_t n = hinge.loop.crossed.size(), step = std::max<std::size_t>(1, n / 16);
    for (const BesideLoop& one : beside)
      for (const Index h : mesh.around(one.vertex)) {
        const Index f = TriangleMesh<double>::face_of(h);
        // Each face once, by its first corner.
        if (mesh.faces()(f, 0) != one.vertex || !near[at(mesh.faces()(f, 1))] || !near[at(mesh.faces()(f, 2))])
          continue;
        const std::size_t k = from[at(one.vertex)];
        const Vector3 chord =
            crossing(mesh, hinge.loop, (k + step) % n) - crossing(mesh, hinge.loop, (k + n - step) % n);
        const Vector3 normal = mesh.normal(f), direction = chord - normal * normal.dot(chord);
        if (direction.norm() > 0) all.push_back({f, direction.normalized(), weight});
      }
    for (const BesideLoop& one : beside) near[at(one.vertex)] = 0;
  }
}

/// Loops that are asked for by the joint's name, of each bone; 0 where they are not. On both sides of a mirror plane
/// the more, since one half stands for both.
[[nodiscard]] inline std::vector<Index> named_loops(const Skeleton& skeleton, const LoopOptions& loops,
                                                    const MirrorPlane* plane) {
  LoopOptions named = loops;
  named.least = 0;
  std::vector<Index> wanted;
  for (const Bone& bone : skeleton.bones) wanted.push_back(named.of(bone.name));
  for (std::size_t b = 0; plane && b < std::min(wanted.size(), plane->twin.size()); ++b)
    if (const Index twin = plane->twin[b]; twin != no_index)
      wanted[b] = wanted[at(twin)] = std::max(wanted[b], wanted[at(twin)]);
  return wanted;
}

/// Makes the quads within a bend so small that `loops` of them have room between its ends: n loops are the lines
/// between n + 1 rows, and the ends of the bend are where rows begin by chance alone.
/// \param edge of a quad there today \param density of each face, in units of which quads are small
inline void densify_bend(const TriangleMesh<double>& mesh, const Hinge& hinge, Index loops, double edge,
                         std::vector<double>& density) {
  constexpr double most = 16;
  constexpr double aspect = 1.5;  // about: quads are longer along a limb than round it
  const double rows = 2 * hinge.bend / (aspect * edge), needed = loops + 2.0;
  if (loops == 0 || rows >= needed) return;
  const double factor = std::min(most, needed * needed / (rows * rows));
  std::vector<char> within(at(mesh.vertex_count()), 0);
  for (const BesideLoop& one : vertices_beside(mesh, hinge.loop, hinge.bend)) within[at(one.vertex)] = 1;
  for (Index f = 0; f < mesh.face_count(); ++f)
    if (within[at(mesh.faces()(f, 0))] && within[at(mesh.faces()(f, 1))] && within[at(mesh.faces()(f, 2))])
      density[at(f)] *= factor;
}

}  // namespace quadrig::detail
