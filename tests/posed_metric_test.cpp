#include "quadrig/constraints/posed_metric.hpp"
#include "quadrig/constraints/gradation.hpp"

#include "corpus/synthetic.hpp"
#include "quadrig/constraints/features.hpp"
#include "quadrig/curves.hpp"
#include "quadrig/prepare.hpp"
#include "surfaces.hpp"
#include "test.hpp"

using namespace quadrig;

namespace {

constexpr double radius = 0.5, length = 6;
const test::Grid tube_grid{32, 72, true, false};

TriangleMesh<double> tube() {
  return test::build(test::tube_positions(tube_grid, length, radius), tube_grid.triangles());
}

// two bones that share the tube's middle third; each end third is held by one of them
Rig hinge(const TriangleMesh<double>& mesh) {
  Rig rig;
  rig.skeleton.bones = {{.head = {0, 0, 0}, .tail = {length / 2, 0, 0}},
                        {.head = {length / 2, 0, 0}, .tail = {length, 0, 0}, .parent = 0}};
  rig.weights.resize(mesh.vertex_count(), 2);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const double t = std::clamp((mesh.positions()(v, 0) - length / 3) / (length / 3), 0.0, 1.0),
                 s = t * t * (3 - 2 * t);
    if (s < 1) rig.weights.insert(v, 0) = 1 - s;
    if (s > 0) rig.weights.insert(v, 1) = s;
  }
  rig.weights.makeCompressed();
  return rig;
}

double x_of(const TriangleMesh<double>& mesh, Index f) {
  return (mesh.positions()(mesh.faces()(f, 0), 0) + mesh.positions()(mesh.faces()(f, 1), 0) +
          mesh.positions()(mesh.faces()(f, 2), 0)) /
         3;
}

double angle_to_axis(const Connection<double>& connection, Index f, Complex direction) {
  return std::acos(std::min(1.0, std::abs(connection.to_vector(f, direction).x())));
}

}  // namespace

TEST_CASE("posed metric: a tube at rest is curved round its axis and its quads run along it", "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  Context context;
  const PosedForms forms = PosedForms::at_rest(mesh, connection);
  const PosedMetric metric = posed_metric(mesh, forms, {}, {}, context).value();
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (x_of(mesh, f) < 0.5 || x_of(mesh, f) > length - 0.5) continue;
    const auto i = static_cast<std::size_t>(f);
    const Complex along = connection.to_complex(f, Vector3::UnitX()), around = along * Complex(0, 1);
    REQUIRE(forms.of_face(f).size() == 1);
    CHECK(forms.of_face(f)[0].at(along) == Approx(0).margin(1e-9));
    CHECK(std::abs(forms.of_face(f)[0].at(around)) == Approx(1 / radius).epsilon(0.01));
    CHECK(angle_to_axis(connection, f, metric.direction[i]) < 1e-3);
    CHECK(metric.aspect[i] == Approx(4));
    CHECK(metric.alignment[i] > 0.8);
    // across the tube a quad of area 1 and aspect 4 spans 1/2: its curvature times its square is (1/4) / r
    CHECK(std::sqrt(metric.error[i]) == Approx(1 / (4 * radius) / std::sqrt(120)).epsilon(0.01));
  }
}

TEST_CASE("posed metric: forms scale with the surface and do not turn with it", "[posed_metric][fast]") {
  const test::Grid grid{24, 48, true, true};
  const Points<double> points = test::torus_positions(grid, 1, 0.4);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3(1, 2, -1).normalized()).toRotationMatrix();
  const auto mesh = test::build(points, grid.triangles());
  const auto other = test::build(Points<double>(3 * points * turn.transpose()), grid.triangles());
  const PosedForms a = PosedForms::at_rest(mesh, Connection<double>(mesh));
  const PosedForms b = PosedForms::at_rest(other, Connection<double>(other));
  Context context;
  const PosedMetric p = posed_metric(mesh, a, {}, {}, context).value(),
                    q = posed_metric(other, b, {}, {}, context).value();
  for (Index f = 0; f < mesh.face_count(); ++f) {
    CHECK(a.of_face(f)[0].xx == Approx(3 * b.of_face(f)[0].xx).margin(1e-9));
    CHECK(a.of_face(f)[0].xy == Approx(3 * b.of_face(f)[0].xy).margin(1e-9));
    const auto i = static_cast<std::size_t>(f);
    CHECK(p.error[i] == Approx(9 * q.error[i]).epsilon(1e-6));
    CHECK(p.density[i] == Approx(q.density[i]).epsilon(1e-6));
  }
}

TEST_CASE("posed metric: the form of a pose is the second form of the posed surface", "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  const Rig rig = hinge(mesh);
  Context context;
  for (const Index smoothing : {0, 1, 3})
    for (const Skinning skinning : {Skinning::linear_blend, Skinning::dual_quaternion}) {
      const Pose pose = bend(rig.skeleton, 1, {0, 0, 1}, 1.0);
      PosedForms::Options options;
      options.skinning = skinning;
      options.smoothing = smoothing;
      options.least_area_ratio = 0;
      options.rest_weight = 0.5;
      options.pose_weights = {1.5};
      const PosedForms forms =
          PosedForms::create(mesh, connection, rig.weights, std::vector<Pose>{pose}, options, context).value();
      const auto posed = test::build(skin(mesh.positions(), rig.weights, pose, skinning), mesh.faces());
      const Connection<double> posed_connection(posed);
      const PosedForms expected = PosedForms::at_rest(posed, posed_connection, smoothing);
      Index moved = 0;
      for (Index f = 0; f < mesh.face_count(); ++f) {
        const auto own = forms.of_face(f);
        double weight = 0;
        for (const auto& form : own) weight += form.weight;
        CHECK(weight == Approx(1));
        moved += own.size() == 2;
        if (own.size() == 2) CHECK(own[1].weight == Approx(0.75));
        for (Index h = 3 * f; h < 3 * f + 3; ++h) {
          const Complex at_rest = connection.to_complex(f, mesh.edge_vector(h));
          const Complex bent = posed_connection.to_complex(f, posed.edge_vector(h));
          CHECK(own.back().at(at_rest) == Approx(expected.of_face(f)[0].at(bent)).margin(1e-9));
        }
      }
      CHECK(moved > mesh.face_count() / 3);
      CHECK(moved < mesh.face_count() / 2);  // the thirds that one bone holds are not looked at again
    }
}

TEST_CASE("posed metric: a pose that moves everything as one body adds nothing", "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  const Rig rig = hinge(mesh);
  Context context;
  const PosedForms forms = PosedForms::create(mesh, connection, rig.weights,
                                              std::vector<Pose>{bend(rig.skeleton, 0, {0, 1, 0}, 1)}, {}, context)
                               .value();
  for (Index f = 0; f < mesh.face_count(); ++f) {
    REQUIRE(forms.of_face(f).size() == 1);
    CHECK(forms.of_face(f)[0].weight == 1);
  }
}

TEST_CASE("posed metric: a hinge draws quads, and more where joints weigh more", "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  const Rig rig = hinge(mesh);
  Context context;
  const PosedForms forms =
      PosedForms::create(mesh, connection, rig.weights, bend_poses(rig.skeleton), {}, context).value();
  std::vector<double> omega1(static_cast<std::size_t>(mesh.face_count()));
  for (Index f = 0; f < mesh.face_count(); ++f)
    omega1[static_cast<std::size_t>(f)] = std::min(1.0, std::abs(x_of(mesh, f) - length / 2));
  double share[3] = {};
  const double joint_weights[3] = {1, 3, 8};
  for (int k = 0; k < 3; ++k) {
    const PosedMetric metric = posed_metric(mesh, forms, omega1, {.joint_weight = joint_weights[k]}, context).value();
    double mean = 0;
    for (Index f = 0; f < mesh.face_count(); ++f) {
      const auto i = static_cast<std::size_t>(f);
      mean += mesh.area(f) * metric.density[i];
      if (std::abs(x_of(mesh, f) - length / 2) < 1) share[k] += mesh.area(f) * metric.density[i];
      CHECK(metric.aspect[i] >= 1);
      CHECK(metric.aspect[i] <= 4 + 1e-12);
      CHECK(std::abs(std::abs(metric.direction[i]) - 1) < 1e-12);
      CHECK(metric.density[i] >= 0.25 - 1e-9);
      CHECK(metric.density[i] <= 16 + 1e-9);
    }
    CHECK(mean == Approx(mesh.total_area()));
  }
  CHECK(share[0] > mesh.total_area() / 3);
  CHECK(share[1] > share[0]);
  CHECK(share[2] > share[1]);
}

TEST_CASE("posed metric: no other direction or aspect leaves a smaller error", "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  const Rig rig = hinge(mesh);
  Context context;
  const PosedForms forms =
      PosedForms::create(mesh, connection, rig.weights, bend_poses(rig.skeleton, 80), {}, context).value();
  const PosedMetric metric = posed_metric(mesh, forms, {}, {}, context).value();
  for (Index f = 0; f < mesh.face_count(); f += 13) {
    const auto i = static_cast<std::size_t>(f);
    const auto error = [&](Complex z, double rho) {
      return forms.mean_square_error(f, z * std::sqrt(rho), Complex(0, 1) * z / std::sqrt(rho));
    };
    CHECK(error(metric.direction[i], metric.aspect[i]) == Approx(metric.error[i]).epsilon(1e-9).margin(1e-15));
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 180; ++k)
      for (double rho = 1; rho < 4.01; rho += 0.05)
        least = std::min(least, error(std::polar(1.0, k * std::numbers::pi / 180), rho));
    CHECK(metric.error[i] <= least * 1.01 + 1e-15);
  }
}

TEST_CASE("posed metric: the error of triangles is that of linear interpolation of a quadratic",
          "[posed_metric][fast]") {
  // The saddle z = C(x, x) / 2 over the plane, and a quad on it cut along either diagonal.
  const double xx = 0.7, xy = -0.4, yy = -0.2;
  const auto height = [&](const Eigen::Vector2d& p) {
    return 0.5 * (xx * p.x() * p.x() + 2 * xy * p.x() * p.y() + yy * p.y() * p.y());
  };
  // A surface so flat that its second form is that of the height.
  const test::Grid fine{40, 40};
  constexpr double flatness = 1e-4;
  const auto mesh = test::build(fine.positions([&](Index i, Index j) {
    const Eigen::Vector2d p(0.1 * i - 2, 0.1 * j - 2);
    return Vector3(p.x(), p.y(), flatness * height(p));
  }),
                                fine.triangles());
  const Connection<double> basis(mesh);
  const PosedForms forms = PosedForms::at_rest(mesh, basis, 0);
  const Index middle = 2 * (20 * 40 + 20);
  const Eigen::Vector2d a(0.9, 0.2), b(-0.3, 0.8);
  double squares = 0;
  constexpr int steps = 300;
  for (int diagonal = 0; diagonal < 2; ++diagonal) {
    const Eigen::Vector2d first = diagonal ? a : Eigen::Vector2d(a + b), second = diagonal ? b : a;
    // by symmetry the two triangles of a cut err alike: corners 0, a, and 0 + a + b or b
    for (int i = 0; i < steps; ++i)
      for (int j = 0; i + j < steps; ++j) {
        const double u = (i + 1.0 / 3) / steps, v = (j + 1.0 / 3) / steps;
        const double error = u * height(first) + v * height(second) - height(u * first + v * second);
        squares += error * error / (steps * (steps + 1.0) / 2) / 2;
      }
  }
  const auto in_basis = [&](const Eigen::Vector2d& p) { return basis.to_complex(middle, Vector3(p.x(), p.y(), 0)); };
  CHECK(forms.mean_square_error(middle, in_basis(a), in_basis(b)) / (flatness * flatness) ==
        Approx(squares).epsilon(0.01));
}

TEST_CASE("posed metric: a plane has density one and no direction", "[posed_metric][fast]") {
  const test::Grid grid{6, 6};
  const auto mesh = test::build(grid.positions([](Index i, Index j) { return Vector3(i, j, 0); }), grid.triangles());
  Context context;
  const PosedMetric metric =
      posed_metric(mesh, PosedForms::at_rest(mesh, Connection<double>(mesh)), {}, {}, context).value();
  for (std::size_t f = 0; f < metric.density.size(); ++f) {
    CHECK(metric.density[f] == Approx(1));
    CHECK(metric.alignment[f] == 0);
  }
}

TEST_CASE("posed metric: the bits are the same at any number of threads", "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  const Rig rig = hinge(mesh);
  PosedMetric first;
  for (const unsigned threads : {1u, 2u, 5u}) {
    Context context;
    context.threads = threads;
    const PosedForms forms =
        PosedForms::create(mesh, connection, rig.weights, bend_poses(rig.skeleton), {}, context).value();
    const PosedMetric metric = posed_metric(mesh, forms, {}, {}, context).value();
    if (threads == 1) first = metric;
    CHECK(metric.direction == first.direction);
    CHECK(metric.aspect == first.aspect);
    CHECK(metric.alignment == first.alignment);
    CHECK(metric.density == first.density);
  }
}

TEST_CASE("posed metric: what does not fit is refused by name", "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  const Rig rig = hinge(mesh);
  const std::vector<Pose> poses = bend_poses(rig.skeleton);
  Context context;
  const auto code = [&](const SkinWeights& weights, const std::vector<Pose>& some, const PosedForms::Options& options) {
    return PosedForms::create(mesh, connection, weights, some, options, context).error().code;
  };
  CHECK(code(SkinWeights(2, 2), poses, {}) == ErrorCode::bad_input);
  CHECK(code(rig.weights, {Pose(3)}, {}) == ErrorCode::bad_input);
  PosedForms::Options options;
  options.pose_weights = {1, 2};
  CHECK(code(rig.weights, poses, options) == ErrorCode::bad_option);
  options.pose_weights.assign(poses.size(), -1);
  CHECK(code(rig.weights, poses, options) == ErrorCode::bad_option);
  options.pose_weights.assign(poses.size(), 0);
  options.rest_weight = 0;
  CHECK(code(rig.weights, poses, options) == ErrorCode::bad_option);
  const PosedForms forms = PosedForms::at_rest(mesh, connection);
  CHECK(posed_metric(mesh, forms, {}, {.largest_aspect = 0.5}, context).error().where == "largest_aspect");
  CHECK(posed_metric(mesh, forms, std::vector<double>(3), {}, context).error().code == ErrorCode::bad_input);
  const std::atomic<bool> stop = true;
  context.cancel_flag = &stop;
  CHECK(code(rig.weights, poses, {}) == ErrorCode::cancelled);
}

TEST_CASE("posed metric: graded sizes change slowly, are never larger, and are left alone when they do already",
          "[posed_metric][fast]") {
  const auto mesh = tube();
  std::mt19937 engine(9);
  std::vector<double> sizes(static_cast<std::size_t>(mesh.face_count()));
  for (double& s : sizes) s = 0.02 + static_cast<double>(engine() % 1000) / 500;
  const std::vector<double> graded = graded_sizes(mesh, sizes, 0.3);
  const auto centre = [&](Index f) -> Vector3 {
    return (mesh.position(mesh.faces()(f, 0)) + mesh.position(mesh.faces()(f, 1)) + mesh.position(mesh.faces()(f, 2))) /
           3;
  };
  double least_in = 1e9, least_out = 1e9;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    const auto i = static_cast<std::size_t>(f);
    CHECK(graded[i] <= sizes[i]);
    least_in = std::min(least_in, sizes[i]);
    least_out = std::min(least_out, graded[i]);
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      if (mesh.twin(h) == no_index) continue;
      const Index g = mesh.twin(h) / 3;
      const Vector3 middle = (mesh.position(mesh.origin(h)) + mesh.position(mesh.target(h))) / 2;
      const double way = (centre(f) - middle).norm() + (centre(g) - middle).norm();
      CHECK(std::abs(graded[i] - graded[static_cast<std::size_t>(g)]) <= 0.3 * way + 1e-12);
    }
  }
  CHECK(least_in == least_out);
  CHECK(graded_sizes(mesh, graded, 0.3) == graded);

  const std::vector<double> density = graded_density(mesh, sizes, 500);
  double mean = 0;
  for (Index f = 0; f < mesh.face_count(); ++f) mean += mesh.area(f) * density[static_cast<std::size_t>(f)];
  CHECK(mean == Approx(mesh.total_area()));
}

TEST_CASE("posed metric: a morph target is a pose: where it goes is curved as a surface that stands there",
          "[posed_metric][fast]") {
  const auto mesh = tube();
  const Connection<double> connection(mesh);
  Points<double> morph = Points<double>::Zero(mesh.vertex_count(), 3);
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    const double x = mesh.positions()(v, 0);
    if (x > 2 && x < 4) morph(v, 2) = 0.3 * std::pow(std::sin(std::numbers::pi * (x - 2) / 2), 2);
  }
  PosedForms::Options options;
  const std::vector<Points<double>> morphs{morph};
  options.morphs = morphs;
  options.smoothing = 0;
  options.least_area_ratio = 0;
  Context context;
  const PosedForms forms = PosedForms::create(mesh, connection, {}, {}, options, context).value();
  const auto there = test::build(Points<double>(mesh.positions() + morph), mesh.faces());
  const Connection<double> posed(there);
  const PosedForms expected = PosedForms::at_rest(there, posed, 0);
  Index compared = 0;
  for (Index f = 0; f < mesh.face_count(); ++f) {
    if (x_of(mesh, f) < 1.5 || x_of(mesh, f) > 4.5) {
      CHECK(forms.of_face(f).size() == 1);
      continue;
    }
    if (forms.of_face(f).size() != 2) continue;
    const PosedForms::Form& form = forms.of_face(f)[1];
    CHECK(form.weight == Approx(0.5));
    // C of the posed surface, pulled back: along the posed edge as along the edge at rest
    for (Index h = 3 * f; h < 3 * f + 3; ++h) {
      const Complex e = connection.to_complex(f, mesh.edge_vector(h)), g = posed.to_complex(f, there.edge_vector(h));
      CHECK(form.at(e) == Approx(expected.of_face(f)[0].at(g)).margin(1e-9));
    }
    ++compared;
  }
  CHECK(compared > 1000);
}

TEST_CASE("posed metric: a box cut open along its edges is flat", "[posed_metric][fast]") {
  const test::Soup cube = test::synthetic::cells({{0, 0, 0}}, 4);
  Context context;
  const auto made = prepare(PolygonMesh::from_triangles(cube.positions(), cube.triangles()), nullptr, {}, context);
  REQUIRE(made);
  const TriangleMesh<double>& mesh = made->mesh;
  const Connection<double> connection(mesh);
  EdgeMarks marks(static_cast<std::size_t>(mesh.halfedge_count()), 0);
  for (const Index h : crease_halfedges(mesh, 1.0)) marks[static_cast<std::size_t>(h)] = 1;
  const CutOpen open = cut_open(mesh, marks);
  CHECK(face_components(open.mesh).count == 6);
  CHECK(open.mesh.vertex_count() == 6 * 25);
  for (Index v = 0; v < open.mesh.vertex_count(); ++v)
    CHECK(open.mesh.position(v) == mesh.position(open.parent[static_cast<std::size_t>(v)]));
  double whole = 0, apart = 0;
  const PosedForms before = PosedForms::at_rest(mesh, connection), after = PosedForms::at_rest(open.mesh, connection);
  for (Index f = 0; f < mesh.face_count(); ++f) {
    whole = std::max({whole, std::abs(before.of_face(f)[0].xx), std::abs(before.of_face(f)[0].yy)});
    apart = std::max({apart, std::abs(after.of_face(f)[0].xx), std::abs(after.of_face(f)[0].yy)});
  }
  CHECK(whole > 0.1);
  CHECK(apart < 1e-9);
}
