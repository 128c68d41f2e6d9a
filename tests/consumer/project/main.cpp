#include "all_headers.hpp"

// Defined in the other translation unit, which includes the same headers in the other order.
int faces_of_tetrahedron_elsewhere();

int main() {
  quadrig::Points<double> points(4, 3);
  points << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  quadrig::Triangles faces(4, 3);
  faces << 0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2;
  const auto mesh = quadrig::TriangleMesh<double>::create(points, faces);
  if (!mesh) return 1;
  return mesh->closed() && mesh->face_count() == faces_of_tetrahedron_elsewhere() ? 0 : 2;
}
