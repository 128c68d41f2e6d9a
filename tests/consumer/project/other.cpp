#include "all_headers_reversed.hpp"

int faces_of_tetrahedron_elsewhere() {
  quadrig::Triangles faces(4, 3);
  faces << 0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2;
  const auto mesh = quadrig::TriangleMesh<double>::create(quadrig::Points<double>::Identity(4, 3), faces);
  return mesh ? mesh->face_count() : -1;
}
