// A term of one's own in the energy of a field: an artist's stroke that the edges of the quads should follow.
#include <cstdio>
#include <numbers>

#include "quadrig/laws.hpp"
#include "quadrig/pipeline.hpp"

using quadrig::Complex;
using quadrig::Index;
using quadrig::Vector3;

// Asks the crosses of the stroke's faces to have an arm along it: x0 = −d⁴ for the direction d in the face's basis.
class Stroke {
 public:
  Stroke(const quadrig::Connection<double>& connection, const std::vector<Index>& faces, const Vector3& direction,
         double weight)
      : weight_(weight) {
    for (const Index face : faces) {
      const Complex d = connection.to_complex(face, direction);
      if (std::abs(d) < 1e-9) continue;  // the direction stands on the face
      faces_.push_back(face);
      targets_.push_back(-quadrig::integer_power(d / std::abs(d), 4));
    }
  }

  [[nodiscard]] static constexpr std::string_view name() { return "stroke"; }
  void for_each_row(quadrig::EmitRow<Complex> emit) const {
    const std::array<Complex, 1> one{Complex(1)};
    for (std::size_t k = 0; k < faces_.size(); ++k) {
      const std::array<Index, 1> at{faces_[k]};
      emit({at, one, targets_[k], weight_});
    }
  }

 private:
  double weight_;
  std::vector<Index> faces_;
  std::vector<Complex> targets_;
};

// A bent sheet of 2 n² triangles over [0, 1]².
static quadrig::TriangleMesh<double> sheet(Index n) {
  quadrig::Points<double> points((n + 1) * (n + 1), 3);
  quadrig::Triangles faces(2 * n * n, 3);
  const auto vertex = [n](Index i, Index j) { return i + j * (n + 1); };
  for (Index j = 0; j <= n; ++j)
    for (Index i = 0; i <= n; ++i) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      points.row(vertex(i, j)) << x, y, 0.2 * std::sin(std::numbers::pi * x);
    }
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i < n; ++i) {
      faces.row(2 * (i + j * n)) << vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1);
      faces.row(2 * (i + j * n) + 1) << vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1);
    }
  return quadrig::TriangleMesh<double>::create(std::move(points), std::move(faces)).value();
}

int main() {
  const quadrig::Asset asset{sheet(24), {}};
  const quadrig::Connection<double> connection(asset.mesh);
  std::vector<Index> middle;
  for (Index f = 0; f < asset.mesh.face_count(); ++f) {
    const Vector3 p = asset.mesh.position(asset.mesh.faces()(f, 0));
    if (std::abs(p.x() - 0.5) < 0.1 && std::abs(p.y() - 0.5) < 0.3) middle.push_back(f);
  }
  const Vector3 direction = Vector3(3, 1, 0).normalized();
  const Stroke stroke(connection, middle, direction, 1.0);
  if (const quadrig::Status lawful = quadrig::check_energy_term<Complex>(stroke, asset.mesh.face_count()); !lawful) {
    std::fprintf(stderr, "%s\n", lawful.error().message().c_str());
    return 1;
  }

  // The term is asked for on every triangulation that a field is designed on; `parent` tells the face of ours.
  quadrig::RemeshOptions options;
  options.quads = 400;
  options.preset = quadrig::FieldPreset::flat;
  options.fit.method = quadrig::FitMethod::none;
  options.directions.terms = [&](const quadrig::TriangleMesh<double>&, const quadrig::Connection<double>& own,
                                 std::span<const Index> parent) {
    std::vector<Index> under;
    for (std::size_t f = 0; f < parent.size(); ++f)
      if (std::find(middle.begin(), middle.end(), parent[f]) != middle.end()) under.push_back(static_cast<Index>(f));
    quadrig::OwnTerms terms;
    terms.x0.emplace_back(Stroke(own, under, direction, 1.0));
    return terms;
  };
  quadrig::Context context;
  const auto result = quadrig::remesh(asset, options, context);
  if (!result) {
    std::fprintf(stderr, "%s\n", result.error().message().c_str());
    return 1;
  }
  const quadrig::QuadMesh& quads = result->mesh;
  int near = 0;
  double off = 0;
  for (Index q = 0; q < quads.quad_count(); ++q)
    for (int i = 0; i < 4; ++i) {
      const Vector3 a = quads.positions.row(quads.quads(q, i)).transpose(),
                    b = quads.positions.row(quads.quads(q, (i + 1) % 4)).transpose(), m = (a + b) / 2;
      if (std::abs(m.x() - 0.5) > 0.08 || std::abs(m.y() - 0.5) > 0.2) continue;
      const double cosine = std::abs((b - a).normalized().dot(direction));
      if (cosine < std::sqrt(0.5)) continue;  // across it
      ++near;
      off += std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi;
    }
  std::printf("%d quads; %d edges run along the stroke, %.1f degrees off it on average\n", quads.quad_count(), near,
              off / near);
  return near > 20 && off < 8 * near ? 0 : 1;  // without it they would be 18 off
}
