// Primitives out of accessors.
#include "reader.hpp"

namespace quadrig::gltf {

Expected<PrimitiveReader> PrimitiveReader::open(State& state, const Json& primitive, const std::string& where,
                                                Budget& budget, Cache& cache) {
  PrimitiveReader reader(state, budget, cache);
  const Expected<std::size_t> mode = whole_member(state, primitive, "mode", where, 4);
  if (!mode) return mode.error();
  const Json* attributes = member(primitive, "attributes");
  if (!attributes || !attributes->is_object()) return state.bad(where, "has no attributes");
  const Json* position = member(*attributes, "POSITION");
  if (*mode < 4 || *mode > 6 || !position) return reader;
  reader.mode_ = *mode;
  if (const Json* extensions = member(primitive, "extensions"))
    if (const Json* draco = member(*extensions, draco_name)) {
      Expected<DracoMesh> mesh = read_draco(state, *draco, where, budget);
      if (!mesh) return mesh.error();
      reader.draco_ = std::move(*mesh);
      reader.mode_ = 4;
    }
  auto points = reader.values("POSITION", *position, where + ".POSITION");
  if (!points) return points.error();
  if ((*points)->cols() != 3) return state.bad(where + ".POSITION", "is not of three numbers");
  reader.positions_ = std::move(*points);
  if (reader.draco_)
    reader.corners_ = std::move(reader.draco_->corners);
  else if (Status status = reader.read_corners(primitive, where); !status)
    return status.error();
  return reader;
}

Expected<std::shared_ptr<const Values>> PrimitiveReader::stored(const Json& json, const std::string& where) const {
  const auto number = whole(json);
  if (!number) return state_->bad(where, "is not the number of an accessor");
  return read_cached(*state_, *number, *budget_, *cache_);
}

std::shared_ptr<const Values> PrimitiveReader::as_accessor(const std::shared_ptr<const Values>& values,
                                                           const Json& json) const {
  const auto number = whole(json);
  if (!number) return values;
  const Expected<AccessorShape> shape = accessor_shape(*state_, *number);
  if (!shape || !shape->normalized) return values;
  return std::make_shared<Values>(
      values->unaryExpr([&](double value) { return normalized_component(value, shape->component_type); }));
}

Expected<std::shared_ptr<const Values>> PrimitiveReader::values(const std::string& name, const Json& json,
                                                                const std::string& where) const {
  auto found = [&]() -> Expected<std::shared_ptr<const Values>> {
    if (draco_)
      if (const auto packed = draco_->attributes.find(name); packed != draco_->attributes.end())
        return draco_->as_stored.contains(name) ? as_accessor(packed->second, json) : packed->second;
    return stored(json, where);
  }();
  if (!found) return found;
  const std::size_t rows = positions_ ? vertices()
                           : draco_   ? draco_->vertices
                                      : static_cast<std::size_t>((*found)->rows());
  if (static_cast<std::size_t>((*found)->rows()) != rows) return state_->bad(where, "has another count than POSITION");
  return found;
}

/// Vertices of the corners, or 0 1 2 … where the primitive has no indices.
Status PrimitiveReader::read_corners(const Json& primitive, const std::string& where) {
  const Json* indices = member(primitive, "indices");
  if (!indices) {
    for (std::size_t v = 0; v < vertices(); ++v) corners_.push_back(v);
    return {};
  }
  const auto values = stored(*indices, where + ".indices");
  if (!values) return values.error();
  if ((*values)->cols() != 1) return state_->bad(where + ".indices", "are not single numbers");
  for (Eigen::Index k = 0; k < (*values)->rows(); ++k) {
    const double v = (**values)(k, 0);
    if (!(v >= 0 && v < static_cast<double>(vertices())) || std::floor(v) != v)
      return state_->bad(where + ".indices", "name vertex " + std::to_string(v) + " of " + std::to_string(vertices()));
    corners_.push_back(static_cast<std::size_t>(v));
  }
  return {};
}

}  // namespace quadrig::gltf
