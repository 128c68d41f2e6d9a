// Face bases, transport and angle defects.
#include "surfaces.hpp"
#include "test.hpp"

#include "quadrig/field/matching.hpp"

using namespace quadrig;
using quadrig::test::Grid;

TEST_CASE("connection: vectors come back from their complex numbers, and transport forth and back is nothing",
          "[connection]") {
  const Grid grid{12, 9, true, true};
  const auto mesh = test::build(test::torus_positions(grid, 2, 0.7), grid.triangles());
  const Connection<double> connection(mesh);
  for (Index h = 0; h < mesh.halfedge_count(); ++h) {
    const Index f = h / 3;
    const Complex z = connection.to_complex(f, mesh.edge_vector(h));
    CHECK((connection.to_vector(f, z) - mesh.edge_vector(h)).norm() < 1e-12);
    CHECK(std::abs(z / std::abs(z) - connection.edge(h)) < 1e-12);
    for (const int n : {1, 2, 4, 6}) {
      const Complex round = connection.transport(mesh, h, n) * connection.transport(mesh, mesh.twin(h), n);
      CHECK(std::abs(round - 1.0) < 1e-12);
      // Along the edge itself transport changes nothing but the basis.
      const Complex here = integer_power(connection.edge(h), n),
                    there = integer_power(-connection.edge(mesh.twin(h)), n);
      CHECK(std::abs(here * connection.transport(mesh, h, n) - there) < 1e-12);
    }
  }
}

TEST_CASE("connection: angle defects sum to 2πχ on closed and open surfaces", "[connection]") {
  const Grid torus{14, 10, true, true}, tube{14, 10, true, false}, sheet{7, 5, false, false};
  const std::array meshes{
      test::build(test::torus_positions(torus, 2, 0.7), torus.triangles()),
      test::build(test::tube_positions(tube, 3, 1), tube.triangles()),
      test::build(sheet.positions([](Index i, Index j) { return Vector3(i, j, 0.1 * i * j); }), sheet.triangles())};
  const std::array<Index, 3> characteristic{0, 0, 1};
  for (std::size_t k = 0; k < meshes.size(); ++k) {
    CHECK(euler_characteristic(meshes[k]) == characteristic[k]);
    CHECK(angle_defects(meshes[k]).sum() == Approx(2 * std::numbers::pi * characteristic[k]).margin(1e-9));
  }
}
