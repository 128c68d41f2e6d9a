// Quads and triangles of a surface into the vertices of its primitives.
#pragma once

#include "primitives.hpp"
#include "shells.hpp"

namespace quadrig::gltf {

/// A surface on its way through.
struct Job {
  Gathered gathered;
  std::vector<PrimitiveBuilder> builders;
  std::vector<Index> primitive_number;  ///< of each primitive of the surface, counted over all meshes of the file
  std::uint64_t flat_faces = 0;         ///< polygons so far whose vertices are theirs alone
};

/// Quads of a field, whose `source` refers to the surface. Before all triangles.
/// \param keep_normals a flag a shell
void add_field(Job& job, const Shells& shells, const RemeshResult& result, const std::map<Index, Index>& claims,
               const std::vector<char>& keep_normals, Index influences);
/// The quads, or the triangles, of a shell that is made of the file's own vertices, with what these carry. Quads before
/// all triangles.
void add_polygons(Job& job, const Shells& shells, const Shell& shell, bool quads, GltfNormals normals,
                  Index influences);

}  // namespace quadrig::gltf
