// Singularities moved, split and cancelled: whole quarter turns of the matching along paths of edges, then the smallest
// rotation of the frames that makes them so.
#pragma once

#include <span>
#include <unordered_map>

#include "quadrig/field.hpp"
#include "quadrig/field/scale_energy.hpp"

namespace quadrig {

struct RepairOptions {
  double edge = 1;   ///< of a quad, a length
  double quads = 0;  ///< about how many there will be
  /// Pairs within this of each other, a length, cancel where the sizes vary less without them; 0: none. For fields
  /// whose directions nobody asked for.
  double needless_reach = 0;
  /// Faces that keep their frames beside those on the border, a flag each; empty: none.
  std::vector<char> held{};
  /// Border vertices that must be no corner, a flag each; empty: any may be.
  std::vector<char> straight{};
  SolverFactory<double> solver = solver_factory<double>();
};

/// Changes a field's singularities where the map cannot take them. Paths of half-edges are gathered, then `apply`
/// turns the frames; the matching is updated and never rounded again, and the report counts what is there.
class FieldSurgery {
 public:
  /// Takes the field; `field` and `release` give it back. Keeps a reference to the mesh.
  /// \param reach a length: over so much frames that are turned come back to the directions that were asked for
  ///   (FieldResult::pull)
  explicit FieldSurgery(const TriangleMesh<double>& mesh, FieldResult field, double reach = 1,
                        SolverFactory<double> factory = solver_factory<double>())
      : mesh_(mesh),
        field_(std::move(field)),
        reach_(reach),
        factory_(std::move(factory)),
        change_(at(mesh.halfedge_count()), 0.0) {}

  /// The field as it is: its frames agree with its matching once `apply` has turned them.
  [[nodiscard]] const FieldResult& field() const { return field_; }
  [[nodiscard]] FieldResult release() && { return std::move(field_); }

  /// Removes singularities that no quads can have, or that too few quads would share: splits those of too few or too
  /// many quads, cancels pairs closer than a quad, and those closer than two where there are fewer than 20 quads a
  /// singularity; `apply` makes it so. \fails cancelled
  [[nodiscard]] Status repair(const RepairOptions& options, const Context& context);
  /// Cancels the closest pair near some faces, and splits what that leaves of too few or too many quads. False where
  /// there is no pair.
  [[nodiscard]] bool repair_near(std::span<const Index> faces, double edge, const Context& context);

  /// One unit of I4 goes from the origin of the half-edge to its target.
  void move_unit(Index h);

  /// Splits vertices whose valence would be below 3 or above 7 by units to or from other vertices, about `spread`
  /// away and all around where there is room for that, else next to it. A corner of the border too sharp for a quad
  /// gives a unit to a wide corner near, or inside. Returns how many units went; fewer once cancelled.
  Index split_extremes(double spread, const Context& context = {});

  /// Cancels pairs of opposite sign that are joined by an edge path shorter than `length`, the closest first; while
  /// there are more than `enough` singularities also those shorter than `crowded`. Returns how many pairs went.
  Index cancel_pairs(double length, double crowded, double enough);

  /// Cancels pairs of opposite sign within `reach` of each other, a length, as long as the size of quads has to vary
  /// less without them, the pair that saves most first. What they shape is lost: for fields that nobody asked for.
  /// Returns how many pairs went. \cost a solve a singularity of such a pair, for the closest of them
  Index cancel_needless(double reach, const Context& context);

  /// Cancels the closest pair of opposite sign among the singularities near some faces. False where there is none.
  bool cancel_near(std::span<const Index> faces);

  /// Turns the frames by the least rotations that undo what the changed matching added to the turns across edges, all
  /// turns so far together being small where the direction was asked for; faces in `held` stay as they are. Turns that
  /// the field had before stay: smoothing them away would leave what the field was designed to follow.
  /// \fails numeric; as the factory does. \cost one sparse factorization with one unknown a face; nothing where nothing
  /// was changed.
  Status apply(const std::vector<char>& held, Context& context);
  /// What solved the last of these systems, in words; empty before.
  [[nodiscard]] const std::string& backend() const { return backend_; }

 private:
  /// Two singularities of opposite sign and the edge path between them.
  struct Pair {
    double length;
    Index plus, minus;
    bool operator<(const Pair& o) const { return std::tie(length, plus, minus) < std::tie(o.length, o.plus, o.minus); }
  };
  /// Those within `reach` of each other, the closest first.
  [[nodiscard]] std::vector<Pair> opposite_pairs(double reach);

  /// Places evenly around an inner vertex for its units, about `spread` away: all of three or more, one of two. None
  /// where there is no room for them.
  std::vector<Index> places(Index v, Index units, double spread);
  /// Places around an inner vertex for `units`, `spread` away or farther: where the size of the quads varies the least.
  /// \param base indices of all vertices without those units; \param least on return the energy with them
  std::vector<Index> roomiest(Index v, Index units, double spread, std::vector<Index> base, ScaleEnergy& energy,
                              double& least);
  /// Moves the units of an inner vertex to places around it.
  Index scatter(Index v, double spread, ScaleEnergy& energy);
  /// Gives a unit of a border vertex to the border vertex near that has most angle to lose, or to one inside.
  bool relieve(Index v, double spread);
  /// Takes a unit for a border vertex of too many quads from a regular vertex inside, `spread` away where there is one.
  bool supply(Index v, double spread);
  /// Angle of the surface at a border vertex.
  [[nodiscard]] double quarter_turns(Index v) const;
  /// One unit from `from` to `to` along the shortest path; the second along the last search.
  void carry(Index from, Index to);
  void follow(Index from, Index to);

  [[nodiscard]] static std::size_t at(Index i) { return detail::at(i); }
  [[nodiscard]] Index index(Index v) const { return field_.singularities.index4[at(v)]; }
  [[nodiscard]] bool straight(Index v) const { return !straight_.empty() && straight_[at(v)]; }
  [[nodiscard]] bool interior(Index v) const { return mesh_.outgoing(v) != no_index && !mesh_.on_boundary(v); }

  /// The half-edge from v to the inner neighbour with the least cost.
  template <class Cost>
  [[nodiscard]] Index best_step(Index v, Cost&& cost) const;

  /// Half-edges from an inner vertex to so many inner neighbours, or as many as there are, those of the least index, as
  /// even around it as its fan allows.
  [[nodiscard]] std::vector<Index> spokes_around(Index v, Index count) const;

  /// Shortest edge paths from seeds over inner vertices; visit(vertex, distance) returns true to stop.
  template <class Visit>
  void search(const std::vector<Index>& seeds, double limit, Visit&& visit);

  bool cancel(Index plus, Index minus);

  const TriangleMesh<double>& mesh_;
  FieldResult field_;
  double reach_;
  SolverFactory<double> factory_;
  std::string backend_;
  std::vector<char> straight_;
  std::vector<double> change_;  ///< of the angles across half-edges since frames were turned last
  std::vector<double> turned_;  // of each face, radians, since the field was made
  std::unordered_map<Index, std::pair<double, Index>> reached_;
  Index moves_ = 0;
};

/// The field without singularities that no quads can have, its frames turned as little as that takes.
/// \pre `field` is of the mesh
/// \cost a factorization with one unknown a vertex and one with one a face, and a few solves for each crowded tip
/// \fails numeric; as the solver's factory; cancelled.
[[nodiscard]] QUADRIG_INLINE Expected<FieldResult> repair_singularities(const TriangleMesh<double>& mesh,
                                                                        FieldResult field, const RepairOptions& options,
                                                                        Context& context);

}  // namespace quadrig

#if !defined(QUADRIG_COMPILED)
#include "quadrig/field/surgery.ipp"
#endif
