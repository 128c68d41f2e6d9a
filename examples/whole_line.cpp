// The whole line, one call an arrow, from plain matrices to skinned quads: no asset, no file, no option that is not
// needed. `remesh` is these calls with a ladder around them for surfaces on which one of them fails.
#include <cstdio>

#include "quadrig/field/surgery.hpp"
#include "quadrig/polish.hpp"
#include "quadrig/quads/integer_map.hpp"
#include "quadrig/transfer.hpp"

using namespace quadrig;

int main() {
  // A tube with a bone in each half, as V (n×3), F (m×3) and W (n×2).
  constexpr Index around = 32, along = 60;
  Eigen::MatrixXd v(around * (along + 1), 3);
  Eigen::MatrixXi f(2 * around * along, 3);
  SkinWeights w(v.rows(), 2);
  for (Index j = 0; j <= along; ++j)
    for (Index i = 0; i < around; ++i) {
      const Index k = i + j * around;
      const double angle = 2 * std::numbers::pi * i / around, x = 4.0 * j / along,
                   bend = 1 / (1 + std::exp(6 * (2 - x)));
      v.row(k) << x, std::sin(angle), std::cos(angle);
      w.insert(k, 0) = 1 - bend;
      w.insert(k, 1) = bend;
      if (j == along) continue;
      const Index right = (i + 1) % around + j * around;
      f.row(2 * k) << k, right, right + around;
      f.row(2 * k + 1) << k, right + around, k + around;
    }
  Rig rig{{{Bone{.head = {0, 0, 0}, .tail = {2, 0, 0}}, Bone{.head = {2, 0, 0}, .tail = {4, 0, 0}}}}, w, {}};

  Context context;
  const auto fail = [](const Error& error) { return std::fprintf(stderr, "%s\n", error.message().c_str()), 1; };
  const auto mesh = TriangleMesh<double>::create(v, f);
  if (!mesh) return fail(mesh.error());
  const Connection<double> connection(*mesh);
  constexpr double count = 600;
  const double edge = std::sqrt(mesh->total_area() / count);
  auto field = design_field(*mesh, &rig, connection, FieldOptions{.quad_edge = edge}, context);
  if (!field) return fail(field.error());
  field = repair_singularities(*mesh, std::move(*field), {.edge = edge, .quads = count}, context);
  if (!field) return fail(field.error());
  const auto map = seamless_map(*mesh, connection, *field, SeamlessOptions{.quads = count}, context);
  if (!map) return fail(map.error());
  const auto integers = integer_map(*mesh, *map, IntegerOptions{.quads = count}, context);
  if (!integers) return fail(integers.error());
  auto extracted = extract(*mesh, *map, *integers, context);
  if (!extracted) return fail(extracted.error());
  const auto [quads, report] = polish(*mesh, PolishOptions{}, quad_mesh(*mesh, std::move(*extracted)), context);
  const auto weights = transfer_weights(*mesh, rig.weights, quads.source, 4);
  if (!weights) return fail(weights.error());

  std::printf("%d quads, least scaled Jacobian %.2f, %d weights\n", quads.quad_count(), report.least_after,
              static_cast<int>(weights->nonZeros()));
  return quads.quad_count() > 500 && quads.quad_count() < 700 && report.least_after > 0.3 ? 0 : 1;
}
