// Substitution with the panels of a large supernodal factor, subtree by subtree.
#pragma once

#include <array>
#include <atomic>
#include <cstring>

#include "quadrig/solver/instructions.hpp"
#include "quadrig/solver/symbolic.hpp"

namespace quadrig::detail {

/// What is read past the end of a panel, and past that of a front: up to a vector.
inline constexpr Index substitution_slack = 8;

#if defined(__GNUC__)  // others go without it

/// What supernodes leave for their parents on the way forward, the last on top, and room for one front.
template <class K>
class SubstitutionStack {
 public:
  void clear() { top_ = 0; }
  void push(const K* from, Index count) {
    const auto size = static_cast<std::size_t>(count);
    if (values_.size() < top_ + size) values_.resize(2 * (top_ + size));
    std::copy_n(from, size, values_.data() + top_);
    top_ += size;
  }
  /// Takes the last `count` numbers off; they stay where they are until the next push.
  const K* pop(std::size_t count) { return values_.data() + (top_ -= count); }
  [[nodiscard]] std::span<const K> all() const { return std::span(values_).first(top_); }

  K* front(Index height) { return room(front_, height); }
  K* turned(Index height) { return room(turned_, height); }

 private:
  static K* room(std::vector<K>& list, Index height) {
    const auto size = static_cast<std::size_t>(height) + substitution_slack;
    if (list.size() < size) list.resize(size);
    return list.data();
  }

  std::vector<K> values_, front_, turned_;
  std::size_t top_ = 0;
};

/// L y' = y, then Lᴴ y'' = y', in place, the unknowns as they are eliminated, over runs of supernodes. Columns go in
/// groups, each sum in an order of its own whatever instructions the compiler may use for it.
/// \pre panels have `substitution_slack` finite numbers after the last
template <class K>
class TreeSubstitution {
 public:
  QUADRIG_INTO_CALLER TreeSubstitution(const SymbolicFactor& symbolic, const K* panels, K* y, const Context& context)
      : symbolic_(symbolic), panels_(panels), y_(y), context_(context) {}

  /// Through the supernodes [first, last), each of which takes what its children left on the stack and leaves what its
  /// parent will take. False once cancelled: the stack is incomplete then.
  QUADRIG_INTO_CALLER bool forward(Index first, Index last, SubstitutionStack<K>& stack) const {
    for (Index s = first; s < last; ++s) {
      if (stopped(s)) return false;
      const Index width = symbolic_.width(s), below = symbolic_.below(s), height = width + below;
      K* const front = stack.front(height);
      K* const own = y_ + symbolic_.first[at(s)];
      std::copy_n(own, width, front);
      std::fill_n(front + width, below + substitution_slack, K{});
      std::size_t left = 0;
      for (Index c = symbolic_.child[at(s)]; c != no_index; c = symbolic_.sibling[at(c)])
        left += at(symbolic_.below(c));
      const K* from = stack.pop(left);
      for (Index c = symbolic_.child[at(s)]; c != no_index; c = symbolic_.sibling[at(c)]) {
        const Index size = symbolic_.below(c);
        const Index* const row = symbolic_.relative.data() + symbolic_.rows_start[at(c)];
        for (Index i = 0; i < size; ++i) front[row[i]] += from[i];
        from += size;
      }
      const K* const panel = panels_ + symbolic_.panel[at(s)];
      Index j = 0;
      for (; j + group <= width; j += group) forward_columns<group>(panel, height, j, front);
      switch (width - j) {
        case 1:
          forward_columns<1>(panel, height, j, front);
          break;
        case 2:
          forward_columns<2>(panel, height, j, front);
          break;
        case 3:
          forward_columns<3>(panel, height, j, front);
          break;
        default:
          break;
      }
      std::copy_n(front, width, own);
      stack.push(front + width, below);
    }
    return true;
  }

  /// Through the supernodes [first, last) from the last, whose rows below are done.
  QUADRIG_INTO_CALLER void backward(Index first, Index last, SubstitutionStack<K>& stack) const {
    for (Index s = last; s-- > first && !stopped(s);) {
      const Index width = symbolic_.width(s), below = symbolic_.below(s), height = width + below;
      K* const front = stack.front(height);
      K* const turned = stack.turned(height);
      K* const own = y_ + symbolic_.first[at(s)];
      const Index* const row = symbolic_.rows.data() + symbolic_.rows_start[at(s)];
      for (Index i = 0; i < below; ++i) set(front, turned, width + i, y_[row[i]]);
      for (Index i = height; i < height + substitution_slack; ++i) set(front, turned, i, K{});
      const K* const panel = panels_ + symbolic_.panel[at(s)];
      Index j = width - width % group;
      switch (width - j) {
        case 1:
          backward_columns<1>(panel, height, j, own, front, turned);
          break;
        case 2:
          backward_columns<2>(panel, height, j, own, front, turned);
          break;
        case 3:
          backward_columns<3>(panel, height, j, own, front, turned);
          break;
        default:
          break;
      }
      for (; j > 0; j -= group) backward_columns<group>(panel, height, j - group, own, front, turned);
    }
  }

 private:
  using Real = real_of<K>;
  static constexpr bool is_complex = !std::is_same_v<K, Real>;
  static constexpr Index group = 4;
  bool stopped(Index s) const { return s % 256 == 0 && context_.cancelled(); }

  // A number and i times its conjugate, whose parts are those of the number in the other order.
  QUADRIG_INTO_CALLER static void set(K* front, K* turned, Index i, const K& value) {
    front[i] = value;
    if constexpr (is_complex) turned[i] = K(value.imag(), value.real());
  }

  // The unknowns [j, j + C), then what they take from the rows after them.
  template <int C>
  QUADRIG_INTO_CALLER void forward_columns(const K* panel, Index height, Index j, K* front) const {
    const K* const corner = panel + static_cast<std::ptrdiff_t>(j) * height + j;
    K own[C];
    for (int c = 0; c < C; ++c) {
      const K* const column = corner + static_cast<std::ptrdiff_t>(c) * height;
      K value = front[j + c];
      for (int d = 0; d < c; ++d) subtract(value, corner[static_cast<std::ptrdiff_t>(d) * height + c], own[d]);
      own[c] = value / std::real(column[c]);
      front[j + c] = own[c];
    }
    const Index rows = height - j - C;
    Real* const to = reinterpret_cast<Real*>(front + j + C);
    const Real* from[C];
    for (int c = 0; c < C; ++c)
      from[c] = reinterpret_cast<const Real*>(corner + static_cast<std::ptrdiff_t>(c) * height + C);
    for (Index i = 0; i < numbers(rows); i += lanes) {
      // Products with the real and the imaginary parts are summed apart, so that no vector is turned in between.
      Lanes re{}, im{};
      for (int c = 0; c < C; ++c) {
        Lanes x;
        load(x, from[c] + i);
        re += x * std::real(own[c]);
        if constexpr (is_complex) im += x * std::imag(own[c]);
      }
      if constexpr (is_complex) add_turned(re, im);
      Lanes rest;
      load(rest, to + i);
      rest -= re;
      std::memcpy(to + i, &rest, sizeof(Lanes));
    }
  }

  // The unknowns [j, j + C), those after them being done.
  template <int C>
  QUADRIG_INTO_CALLER void backward_columns(const K* panel, Index height, Index j, K* own, K* front, K* turned) const {
    const K* const corner = panel + static_cast<std::ptrdiff_t>(j) * height + j;
    const Index rows = height - j - C;
    const Real* const x = reinterpret_cast<const Real*>(front + j + C);
    const Real* const t = reinterpret_cast<const Real*>(turned + j + C);
    const Real* from[C];
    for (int c = 0; c < C; ++c)
      from[c] = reinterpret_cast<const Real*>(corner + static_cast<std::ptrdiff_t>(c) * height + C);
    Lanes re[C] = {}, im[C] = {};
    for (Index i = 0; i < numbers(rows); i += lanes) {
      Lanes a, b;
      load(a, x + i);
      if constexpr (is_complex) load(b, t + i);
      for (int c = 0; c < C; ++c) {
        Lanes z;
        load(z, from[c] + i);
        re[c] += z * a;
        if constexpr (is_complex) im[c] += z * b;
      }
    }
    for (int c = C; c-- > 0;) {
      K value = own[j + c];
      Real sum = 0, cross = 0;
      for (Index l = 0; l < lanes; l += 2) {
        sum += re[c][l] + re[c][l + 1];
        if constexpr (is_complex) cross += im[c][l] - im[c][l + 1];
      }
      if constexpr (is_complex)
        value -= K(sum, cross);
      else
        value -= sum;
      const K* const column = corner + static_cast<std::ptrdiff_t>(c) * height;
      for (int d = c + 1; d < C; ++d) subtract(value, conjugate(column[d]), front[j + d]);
      value /= std::real(column[c]);
      own[j + c] = value;
      set(front, turned, j + c, value);
    }
  }

  // Entries of a vector, and of that many rows.
  static constexpr Index lanes = static_cast<Index>(32 / sizeof(Real));
  static Index numbers(Index rows) { return (is_complex ? 2 : 1) * rows; }
  typedef Real Lanes __attribute__((vector_size(32)));
  QUADRIG_INTO_CALLER static void load(Lanes& to, const Real* from) { std::memcpy(&to, from, sizeof(Lanes)); }
  // re += i im, of pairs of real and imaginary parts.
  QUADRIG_INTO_CALLER static void add_turned(Lanes& re, const Lanes& im) {
    if constexpr (lanes == 8)
      re += __builtin_shufflevector(im, im, 1, 0, 3, 2, 5, 4, 7, 6) * Lanes{-1, 1, -1, 1, -1, 1, -1, 1};
    else
      re += __builtin_shufflevector(im, im, 1, 0, 3, 2) * Lanes{-1, 1, -1, 1};
  }
  QUADRIG_INTO_CALLER static void subtract(K& value, const K& a, const K& b) {
    if constexpr (is_complex)
      value = K(value.real() - (a.real() * b.real() - a.imag() * b.imag()),
                value.imag() - (a.real() * b.imag() + a.imag() * b.real()));
    else
      value -= a * b;
  }

  const SymbolicFactor& symbolic_;
  const K* panels_;
  K* y_;
  const Context& context_;
};

/// L Lᴴ y' = y in place over disjoint subtrees side by side, and what is above them. The bits depend on neither the
/// subtrees nor the threads, but are not those of `substitute`. y is invalid once the context is cancelled.
template <class K>
void substitute_by_tree(const SymbolicFactor& symbolic, std::span<const Index> roots, const K* panels, K* y,
                        const Context& context) {
  const TreeSubstitution<K> pass(symbolic, panels, y, context);
  const auto forward = [&](Index first, Index last, SubstitutionStack<K>& stack) {
    bool done = false;
    run_best([&pass, &stack, &done, first, last](auto)
                 QUADRIG_INTO_CALLER_LAMBDA { done = pass.forward(first, last, stack); });
    return done;
  };
  const auto backward = [&](Index first, Index last, SubstitutionStack<K>& stack) {
    run_best([&pass, &stack, first, last](auto) QUADRIG_INTO_CALLER_LAMBDA { pass.backward(first, last, stack); });
  };
  const auto each_subtree = [&](auto&& body) {
    std::atomic<std::size_t> next{0};
    context.parallel_for(std::min<std::size_t>(context.thread_count(), roots.size()), 1, [&](std::size_t, std::size_t) {
      SubstitutionStack<K> stack;
      for (std::size_t k = 0; (k = next.fetch_add(1)) < roots.size();) body(k, stack);
    });
  };

  std::vector<std::vector<K>> left(roots.size());
  std::atomic<bool> done{true};
  each_subtree([&](std::size_t k, SubstitutionStack<K>& stack) {
    stack.clear();
    if (!forward(symbolic.first_in_tree[at(roots[k])], roots[k] + 1, stack)) done = false;
    left[k].assign(stack.all().begin(), stack.all().end());
  });
  if (!done) return;
  std::vector<std::pair<Index, std::size_t>> ascending;
  for (std::size_t k = 0; k < roots.size(); ++k) ascending.emplace_back(roots[k], k);
  std::sort(ascending.begin(), ascending.end());
  SubstitutionStack<K> stack;
  Index next = 0;
  for (const auto& [root, k] : ascending) {
    if (!forward(next, symbolic.first_in_tree[at(root)], stack)) return;
    stack.push(left[k].data(), static_cast<Index>(left[k].size()));
    next = root + 1;
  }
  if (!forward(next, symbolic.supernode_count(), stack)) return;
  next = symbolic.supernode_count();
  for (std::size_t a = ascending.size(); a-- > 0;) {
    backward(ascending[a].first + 1, next, stack);
    next = symbolic.first_in_tree[at(ascending[a].first)];
  }
  backward(0, next, stack);
  each_subtree([&](std::size_t k, SubstitutionStack<K>& own) {
    backward(symbolic.first_in_tree[at(roots[k])], roots[k] + 1, own);
  });
}
#endif

}  // namespace quadrig::detail
