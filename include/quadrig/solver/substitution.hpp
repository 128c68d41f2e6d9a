// Forward and backward substitution with the panels of a supernodal factor.
#pragma once

#include "quadrig/solver/instructions.hpp"
#include "quadrig/solver/symbolic.hpp"

namespace quadrig::detail {

/// L y' = y, then Lᴴ y'' = y', in place, the unknowns as they are eliminated. Every sum has its own order, whatever
/// instructions the compiler may use for it.
template <class K>
class Substitution {
 public:
  QUADRIG_INTO_CALLER Substitution(const SymbolicFactor& symbolic, const K* panels, K* y)
      : symbolic_(symbolic), panels_(panels), y_(y) {}

  QUADRIG_INTO_CALLER void run(const Context* context) {
    Index tallest = 0;
    for (Index s = 0; s < symbolic_.supernode_count(); ++s) tallest = std::max(tallest, symbolic_.below(s));
    std::vector<K> gathered(at(tallest));
    const auto stopped = [&](Index s) { return s % 256 == 0 && context && context->cancelled(); };
    for (Index s = 0; s < symbolic_.supernode_count() && !stopped(s); ++s) forward(s, gathered.data());
    for (Index s = symbolic_.supernode_count(); s-- > 0 && !stopped(s);) backward(s, gathered.data());
  }

 private:
  using Real = real_of<K>;
  static std::ptrdiff_t offset(Index column, Index stride) { return static_cast<std::ptrdiff_t>(column) * stride; }

  QUADRIG_INTO_CALLER void forward(Index s, K* gathered) const {
    const Index width = symbolic_.width(s), below = symbolic_.below(s), height = width + below;
    const K* const column = panels_ + symbolic_.panel[at(s)];
    K* const own = y_ + symbolic_.first[at(s)];
    const Index* const row = symbolic_.rows.data() + symbolic_.rows_start[at(s)];
    for (Index j = 0; j < width; ++j) {
      own[j] /= std::real(column[offset(j, height) + j]);
      axpy(own + j + 1, column + offset(j, height) + j + 1, own[j], width - j - 1);
    }
    std::fill_n(gathered, below, K{});
    Index j = 0;
    for (; j + 2 <= width; j += 2)
      axpy(gathered, column + offset(j, height) + width, own[j], column + offset(j + 1, height) + width, own[j + 1],
           below);
    if (j < width) axpy(gathered, column + offset(j, height) + width, own[j], below);
    for (Index i = 0; i < below; ++i) y_[row[i]] += gathered[i];
  }

  QUADRIG_INTO_CALLER void backward(Index s, K* gathered) const {
    const Index width = symbolic_.width(s), below = symbolic_.below(s), height = width + below;
    K* const own = y_ + symbolic_.first[at(s)];
    const Index* const row = symbolic_.rows.data() + symbolic_.rows_start[at(s)];
    for (Index i = 0; i < below; ++i) gathered[i] = y_[row[i]];
    for (Index j = width; j-- > 0;) {
      const K* const column = panels_ + symbolic_.panel[at(s)] + static_cast<std::ptrdiff_t>(j) * height;
      const K sum = dot(column + j + 1, own + j + 1, width - j - 1) + dot(column + width, gathered, below);
      own[j] = (own[j] - sum) / std::real(column[j]);
    }
  }

  // y −= factor x + other z
  QUADRIG_INTO_CALLER static void axpy(K* y, const K* x, K factor, const K* z, K other, Index size) {
    if constexpr (std::is_same_v<K, Real>) {
      for (Index i = 0; i < size; ++i) y[i] -= factor * x[i] + other * z[i];
    } else {
      const Real a = factor.real(), b = factor.imag(), c = other.real(), d = other.imag();
      for (Index i = 0; i < size; ++i)
        y[i] = K(y[i].real() - ((x[i].real() * a - x[i].imag() * b) + (z[i].real() * c - z[i].imag() * d)),
                 y[i].imag() - ((x[i].real() * b + x[i].imag() * a) + (z[i].real() * d + z[i].imag() * c)));
    }
  }
  // y −= factor x
  QUADRIG_INTO_CALLER static void axpy(K* y, const K* x, K factor, Index size) {
    if constexpr (std::is_same_v<K, Real>) {
      for (Index i = 0; i < size; ++i) y[i] -= factor * x[i];
    } else {
      const Real a = factor.real(), b = factor.imag();
      Real* const to = reinterpret_cast<Real*>(y);
      const Real* const from = reinterpret_cast<const Real*>(x);
      for (Index i = 0; i < 2 * size; i += 2) {
        const Real re = from[i], im = from[i + 1];
        to[i] -= re * a - im * b;
        to[i + 1] -= re * b + im * a;
      }
    }
  }
  // Σ x̄ y, in a few sums side by side
  QUADRIG_INTO_CALLER static K dot(const K* x, const K* y, Index size) {
    constexpr Index lanes = 4;
    std::array<Real, lanes> re{}, im{};
    const auto add = [&](std::size_t lane, Index i) {
      if constexpr (std::is_same_v<K, Real>) {
        re[lane] += x[i] * y[i];
      } else {
        re[lane] += x[i].real() * y[i].real() + x[i].imag() * y[i].imag();
        im[lane] += x[i].real() * y[i].imag() - x[i].imag() * y[i].real();
      }
    };
    Index i = 0;
    for (; i + lanes <= size; i += lanes)
      for (Index lane = 0; lane < lanes; ++lane) add(at(lane), i + lane);
    for (; i < size; ++i) add(0, i);
    const Real total_re = (re[0] + re[1]) + (re[2] + re[3]);
    if constexpr (std::is_same_v<K, Real>)
      return total_re;
    else
      return K(total_re, (im[0] + im[1]) + (im[2] + im[3]));
  }

  const SymbolicFactor& symbolic_;
  const K* panels_;
  K* y_;
};

/// y is invalid once the context is cancelled.
template <class K>
void substitute(const SymbolicFactor& symbolic, const K* panels, K* y, const Context* context) {
  Substitution<K> pass(symbolic, panels, y);
  run_best([&pass, context](auto) QUADRIG_INTO_CALLER_LAMBDA { pass.run(context); });
}

}  // namespace quadrig::detail
