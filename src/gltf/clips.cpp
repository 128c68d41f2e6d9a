// Animations, sampled.
#include "nodes.hpp"

namespace quadrig::gltf {
namespace {

enum class Path : std::uint8_t { translation, rotation, scale };
enum class Interpolation : std::uint8_t { linear, step, cubic };

struct Channel {
  std::size_t node = 0;
  Path path = Path::translation;
  Interpolation interpolation = Interpolation::linear;
  std::shared_ptr<const Values> times, values;
};

Eigen::Vector4d key(const Channel& channel, Eigen::Index i) {
  Eigen::Vector4d value = Eigen::Vector4d::Zero();
  const Eigen::Index width = channel.path == Path::rotation ? 4 : 3;
  value.head(width) = channel.values->row(i).head(width).transpose();
  return value;
}

/// glTF 2.0, appendix C: clamped at both ends; spherical for rotations that are linear.
/// The rotation a share t of the shorter way from one to another. \pre both have length 1. Source: Shoemake 1985.
Eigen::Vector4d between(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to, double t) {
  const double cosine = from.dot(to), sign = cosine < 0 ? -1 : 1;
  const double angle = elementary::acos(std::min(1.0, std::abs(cosine))), whole = elementary::sin(angle);
  if (!(whole > 1e-8)) return (1 - t) * from.coeffs() + t * sign * to.coeffs();
  return elementary::sin((1 - t) * angle) / whole * from.coeffs() +
         sign * elementary::sin(t * angle) / whole * to.coeffs();
}

Eigen::Vector4d sample(const Channel& channel, double time) {
  const Values& times = *channel.times;
  const Eigen::Index count = times.rows();
  const bool cubic = channel.interpolation == Interpolation::cubic;
  const auto value = [&](Eigen::Index i) { return key(channel, cubic ? 3 * i + 1 : i); };
  if (time <= times(0, 0)) return value(0);
  if (time >= times(count - 1, 0)) return value(count - 1);
  const double* first = times.data();
  const Eigen::Index next = std::upper_bound(first, first + count, time) - first, before = next - 1;
  if (channel.interpolation == Interpolation::step) return value(before);
  const double span = times(next, 0) - times(before, 0), t = (time - times(before, 0)) / span;
  if (cubic) {
    const double t2 = t * t, t3 = t2 * t;
    return (2 * t3 - 3 * t2 + 1) * value(before) + span * (t3 - 2 * t2 + t) * key(channel, 3 * before + 2) +
           (-2 * t3 + 3 * t2) * value(next) + span * (t3 - t2) * key(channel, 3 * next);
  }
  if (channel.path == Path::rotation) {
    const Eigen::Vector4d a = value(before), b = value(next);
    const Eigen::Quaterniond from(a[3], a[0], a[1], a[2]), to(b[3], b[0], b[1], b[2]);
    if (from.norm() > 0 && to.norm() > 0) return between(from.normalized(), to.normalized(), t);
  }
  return (1 - t) * value(before) + t * value(next);
}

/// The channel, or nothing where it moves no node (weights of morph targets, pointers of extensions).
Expected<std::optional<Channel>> read_channel(State& state, const NodeTree& tree, const Json& animation,
                                              const Json& json, const std::string& where, Budget& budget,
                                              Cache& cache) {
  using Result = std::optional<Channel>;
  const Json* target = member(json, "target");
  const Json* path = target ? member(*target, "path") : nullptr;
  if (!path || !path->is_string()) return state.bad(where + ".target", "has no path");
  Channel channel;
  const auto& named = path->get_ref<const std::string&>();
  if (named == "translation")
    channel.path = Path::translation;
  else if (named == "rotation")
    channel.path = Path::rotation;
  else if (named == "scale")
    channel.path = Path::scale;
  else
    return Result{};
  if (!member(*target, "node")) return Result{};
  const Expected<std::size_t> node = whole_member(state, *target, "node", where + ".target");
  if (!node) return node.error();
  if (*node >= tree.nodes.size()) return state.bad(where + ".target.node", "is not there");
  channel.node = *node;
  const Expected<std::size_t> number = whole_member(state, json, "sampler", where);
  if (!number) return number.error();
  const Json& samplers = array_of(animation, "samplers");
  if (*number >= samplers.size()) return state.bad(where + ".sampler", "is not there");
  const Json& sampler = samplers[*number];
  if (const Json* interpolation = member(sampler, "interpolation"); interpolation && interpolation->is_string()) {
    const auto& word = interpolation->get_ref<const std::string&>();
    if (word == "STEP")
      channel.interpolation = Interpolation::step;
    else if (word == "CUBICSPLINE")
      channel.interpolation = Interpolation::cubic;
    else if (word != "LINEAR")
      return state.bad(where + ".sampler", "has an interpolation that glTF has not");
  }
  const Expected<std::size_t> input = whole_member(state, sampler, "input", where + ".sampler");
  if (!input) return input.error();
  const Expected<std::size_t> output = whole_member(state, sampler, "output", where + ".sampler");
  if (!output) return output.error();
  const auto times = read_cached(state, *input, budget, cache);
  if (!times) return times.error();
  const auto values = read_cached(state, *output, budget, cache);
  if (!values) return values.error();
  channel.times = *times;
  channel.values = *values;
  const Eigen::Index keys = (*times)->rows(), width = channel.path == Path::rotation ? 4 : 3;
  if (keys == 0 || (*times)->cols() != 1 || (*values)->cols() != width ||
      (*values)->rows() != (channel.interpolation == Interpolation::cubic ? 3 * keys : keys))
    return state.bad(where, "has keys that do not fit its times");
  if (!(*times)->allFinite() || !(*values)->allFinite()) return state.bad(where, "has keys that are not finite");
  for (Eigen::Index i = 1; i < keys; ++i)
    if (!((**times)(i, 0) > (**times)(i - 1, 0))) return state.bad(where, "has times that do not ascend");
  return Result{std::move(channel)};
}

}  // namespace

Expected<std::vector<Clip>> read_clips(State& state, const NodeTree& tree, const Skin& skin, double frames_per_second,
                                       Budget& budget, Budget& frame_budget) {
  std::vector<Clip> clips;
  Cache cache;
  std::size_t frames_left = state.limits.frames;
  const Json& animations = array_of(state.json, "animations");
  std::vector<char> moves(tree.nodes.size(), 0);  // joints and what is above them
  for (const std::size_t joint : skin.joints)
    for (std::size_t up = joint; up != Node::no_node && !moves[up]; up = tree.nodes[up].parent) moves[up] = 1;
  std::vector<std::size_t> order;
  for (const std::size_t i : tree.order)
    if (moves[i]) order.push_back(i);

  for (std::size_t a = 0; a < animations.size(); ++a) {
    const std::string where = numbered("animations", a);
    const Json& listed = array_of(animations[a], "channels");
    std::vector<Channel> channels;
    for (std::size_t c = 0; c < listed.size(); ++c) {
      Expected<std::optional<Channel>> channel =
          read_channel(state, tree, animations[a], listed[c], where + "." + numbered("channels", c), budget, cache);
      if (!channel) return channel.error();
      if (*channel && moves[(*channel)->node]) channels.push_back(std::move(**channel));
    }
    if (channels.empty()) continue;
    double first = (*channels.front().times)(0, 0), last = first;
    for (const Channel& channel : channels) {
      first = std::min(first, (*channel.times)(0, 0));
      last = std::max(last, (*channel.times)(channel.times->rows() - 1, 0));
    }
    const double wanted = std::ceil((last - first) * frames_per_second) + 1;
    if (!(wanted <= static_cast<double>(frames_left)))
      return state.unsupported(where, "asks for more poses than the limit of " + std::to_string(state.limits.frames),
                               "sample fewer frames a second or raise the limit");
    const auto frames = static_cast<std::size_t>(wanted);
    frames_left -= frames;
    const std::size_t steps = 16 * (order.size() + channels.size());
    if (Status status = charge(state, frame_budget, frames, steps, where); !status) {
      Error error = status.error();
      error.code = ErrorCode::unsupported;
      error.remedy = "sample fewer frames a second or raise the limit";
      return error;
    }
    Clip clip;
    if (const Json* name = member(animations[a], "name"); name && name->is_string())
      clip.name = name->get<std::string>();
    std::vector<Node> posed = tree.nodes;
    for (std::size_t k = 0; k < frames; ++k) {
      const double time =
          frames == 1 ? first : first + (last - first) * static_cast<double>(k) / static_cast<double>(frames - 1);
      for (const Channel& channel : channels) {
        Node& node = posed[channel.node];
        const Eigen::Vector4d value = sample(channel, time);
        if (channel.path == Path::translation)
          node.translation = value.head<3>();
        else if (channel.path == Path::rotation)
          node.rotation = value;
        else
          node.scale = value.head<3>();
      }
      const std::vector<Eigen::Affine3d> world = NodeTree::world(posed, order);
      Pose pose;
      pose.reserve(skin.joints.size());
      for (std::size_t j = 0; j < skin.joints.size(); ++j)
        pose.push_back(skin.to_mesh * world[skin.joints[j]] * skin.inverse_bind[j]);
      clip.times_seconds.push_back(time - first);
      clip.poses.push_back(std::move(pose));
    }
    clips.push_back(std::move(clip));
  }
  return clips;
}

}  // namespace quadrig::gltf
