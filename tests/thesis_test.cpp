// What the thesis says of its trivial cases (5.3, 5.4) and of weights (5.7, 5.8).
#include <algorithm>
#include <cmath>

#include "quadrig/field.hpp"
#include "quadrig/samples.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

Asset thesis_sample(std::string_view name, Index triangles) {
  Context context;
  auto sample = make_sample(name, triangles, context);
  REQUIRE(sample);
  return std::move(*sample);
}

FieldResult thesis_field(const Asset& asset, FieldPreset preset) {
  Context context;
  FieldOptions options;
  options.preset = preset;
  auto field = design_field(asset, Connection<double>(asset.mesh), options, context);
  REQUIRE(field);
  return std::move(*field);
}

std::vector<Vector3> singular_places(const Asset& asset, const FieldResult& field) {
  std::vector<Vector3> places;
  for (Index v = 0; v < asset.mesh.vertex_count(); ++v)
    if (field.singularities.index4[static_cast<std::size_t>(v)] != 0) places.push_back(asset.mesh.position(v));
  return places;
}

/// Share of the area where more quads than in a unit cross are asked for.
double dense_share(const Asset& asset, const FieldResult& field) {
  double dense = 0;
  for (Index f = 0; f < asset.mesh.face_count(); ++f) {
    const auto at = static_cast<std::size_t>(f);
    if (std::abs(field.frames.u[at]) * std::abs(field.frames.v[at]) > 1.1) dense += asset.mesh.area(f);
  }
  return dense / asset.mesh.total_area();
}

}  // namespace

TEST_CASE("thesis: singularities of the pear are at its tips alone", "[thesis][field]") {
  for (const Index triangles : {5000, 20000}) {
    const Asset pear = thesis_sample("pear", triangles);
    const double low = pear.mesh.positions().col(1).minCoeff(), high = pear.mesh.positions().col(1).maxCoeff();
    for (const FieldPreset preset : {FieldPreset::thesis, FieldPreset::standard}) {
      const FieldResult field = thesis_field(pear, preset);
      const std::vector<Vector3> places = singular_places(pear, field);
      CHECK(field.singularities.sum == 8);
      CHECK(places.size() >= 6);
      for (const Vector3& p : places) {
        CAPTURE(triangles, p.transpose());
        CHECK(std::min(p.y() - low, high - p.y()) < 0.03 * (high - low));
        CHECK(std::hypot(p.x(), p.z()) < 0.1 * (high - low));
      }
    }
  }
}

TEST_CASE("thesis: singularities of the box torus are where its bones meet, and cancel", "[thesis][field]") {
  const Asset torus = thesis_sample("box_torus", 20000);
  for (const FieldPreset preset : {FieldPreset::thesis, FieldPreset::standard}) {
    const FieldResult field = thesis_field(torus, preset);
    CHECK(field.singularities.sum == 0);
    CHECK(field.singularities.plus == field.singularities.minus);
    const std::vector<Vector3> places = singular_places(torus, field);
    CHECK_FALSE(places.empty());
    for (const Vector3& p : places) {
      // Bones meet at (±1, 0, ±1), and the planes through the middle and these corners part one bone's side from the
      // next.
      CAPTURE(p.transpose());
      CHECK(std::abs(std::abs(p.x()) - std::abs(p.z())) < 0.1);
    }
  }
}

TEST_CASE("thesis: piecewise constant weights make nothing denser", "[thesis][field]") {
  Asset pear = thesis_sample("pear", 20000);
  CHECK(dense_share(pear, thesis_field(pear, FieldPreset::thesis)) > 0.5);
  Rig& rig = *pear.rig;
  std::vector<Eigen::Triplet<double, Index>> entries;
  for (Index v = 0; v < pear.mesh.vertex_count(); ++v) {
    Index strongest = 0;
    for (Index b = 1; b < rig.skeleton.bone_count(); ++b)
      if (rig.weights.coeff(v, b) > rig.weights.coeff(v, strongest)) strongest = b;
    entries.emplace_back(v, strongest, 1.0);
  }
  rig.weights.setFromTriplets(entries.begin(), entries.end());
  CHECK(dense_share(pear, thesis_field(pear, FieldPreset::thesis)) < 0.01);
}
