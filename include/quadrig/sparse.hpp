// The matrix that terms fill and backends factor: sparse Hermitian, its lower triangle by columns.
#pragma once

#include <memory>
#include <span>

#include <Eigen/SparseCore>

#include "quadrig/context.hpp"

namespace quadrig {

namespace detail {
template <class K>
struct RealOf {
  using type = K;
};
template <class T>
struct RealOf<std::complex<T>> {
  using type = T;
};

/// Above this size: nested dissection, substitution by subtrees and, for fields, mixed precision. Below it they do not
/// pay, and would change the last bits.
inline constexpr Index large_system = 300'000;

/// An allocator that leaves elements uninitialized, for large arrays that are first written in parallel.
template <class T>
struct Untouched : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = Untouched<U>;
  };
  template <class U>
  void construct(U*) const noexcept {}
  template <class U, class... Args>
  void construct(U* place, Args&&... args) const {
    ::new (static_cast<void*>(place)) U(std::forward<Args>(args)...);
  }
};
}  // namespace detail

/// float or double, the real type under K.
template <class K>
using real_of = typename detail::RealOf<K>::type;

/// The four number types that forms and solvers are made for.
template <class K>
concept SparseScalar = std::is_same_v<K, float> || std::is_same_v<K, double> ||
    std::is_same_v<K, std::complex<float>> || std::is_same_v<K, std::complex<double>>;

/// The complex conjugate, and the number itself where K is real.
template <class K>
[[nodiscard]] constexpr K conjugate(const K& z) {
  if constexpr (std::is_same_v<K, real_of<K>>)
    return z;
  else
    return std::conj(z);
}

/// sum += a b, without the care for infinities that the language asks of complex products.
template <class K>
constexpr void add_product(K& sum, const K& a, const K& b) {
  if constexpr (std::is_same_v<K, real_of<K>>)
    sum += a * b;
  else
    sum = K(sum.real() + (a.real() * b.real() - a.imag() * b.imag()),
            sum.imag() + (a.real() * b.imag() + a.imag() * b.real()));
}

/// Borrowed lower triangle of an n×n Hermitian matrix, compressed by columns: column j holds the entries
/// [column_starts[j], column_starts[j + 1]) of rows and values, rows ascending, the diagonal first and always present.
template <class K>
struct HermitianView {
  Index size = 0;
  std::span<const Index> column_starts;  ///< size + 1
  std::span<const Index> rows;
  std::span<const K> values;
};

/// A view of Eigen's sparse matrix, which it borrows. `lower` holds the lower triangle, as
/// `A.triangularView<Eigen::Lower>()` of a whole one does.
/// \fails bad_input where it is not square or not compressed, holds an entry above the diagonal, or lacks one on it:
///   names the column. \cost O(nonzeros), no copy
template <SparseScalar K>
[[nodiscard]] Expected<HermitianView<K>> hermitian_view(const Eigen::SparseMatrix<K, Eigen::ColMajor, Index>& lower) {
  const auto fail = [](std::string what, Index column, const char* remedy) {
    return Error{ErrorCode::bad_input, std::move(what), "matrix, column " + std::to_string(column), remedy};
  };
  if (lower.rows() != lower.cols() || !lower.isCompressed())
    return Error{ErrorCode::bad_input, "the matrix is not square and compressed", "matrix", "call makeCompressed()"};
  const auto n = static_cast<Index>(lower.cols());
  for (Index j = 0; j < n; ++j) {
    const Index begin = lower.outerIndexPtr()[j], end = lower.outerIndexPtr()[j + 1];
    if (begin < end && lower.innerIndexPtr()[begin] < j)
      return fail("an entry lies above the diagonal", j, "pass A.triangularView<Eigen::Lower>()");
    if (begin == end || lower.innerIndexPtr()[begin] != j)
      return fail("the diagonal has no entry", j, "store every entry of the diagonal, also where it is zero");
  }
  const auto count = static_cast<std::size_t>(lower.nonZeros());
  return HermitianView<K>{
      n, {lower.outerIndexPtr(), detail::at(n) + 1}, {lower.innerIndexPtr(), count}, {lower.valuePtr(), count}};
}
/// What it borrows would be gone.
template <SparseScalar K>
void hermitian_view(const Eigen::SparseMatrix<K, Eigen::ColMajor, Index>&&) = delete;

/// Lower-triangular storage whose pattern is kept while values change.
template <class K>
struct HermitianMatrix {
  Index size = 0;
  std::vector<Index> column_starts{0};
  std::vector<Index> rows;
  std::vector<K> values;

  [[nodiscard]] HermitianView<K> view() const { return {size, column_starts, rows, values}; }
};

/// y = A x.
/// \pre x and y have A.size entries and do not overlap. \cost O(nonzeros). \fails never
template <class K>
void multiply(const HermitianView<K>& A, std::span<const K> x, std::span<K> y) {
  std::fill(y.begin(), y.end(), K{});
  for (Index j = 0; j < A.size; ++j) {
    const auto column = static_cast<std::size_t>(j);
    auto entry = static_cast<std::size_t>(A.column_starts[column]);
    const auto end = static_cast<std::size_t>(A.column_starts[column + 1]);
    const K x_j = x[column];
    K sum{};
    add_product(sum, A.values[entry], x_j);
    for (++entry; entry < end; ++entry) {
      const auto row = static_cast<std::size_t>(A.rows[entry]);
      add_product(y[row], A.values[entry], x_j);
      add_product(sum, conjugate(A.values[entry]), x[row]);
    }
    y[column] += sum;
  }
}

/// |A x − b| / |b|; |A x − b| itself where b vanishes.
template <class K>
[[nodiscard]] real_of<K> relative_residual(const HermitianView<K>& A, std::span<const K> x, std::span<const K> b) {
  std::vector<K> product(x.size());
  multiply(A, x, std::span<K>(product));
  real_of<K> residual = 0, scale = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    residual += std::norm(product[i] - b[i]);
    scale += std::norm(b[i]);
  }
  return scale > 0 ? std::sqrt(residual / scale) : std::sqrt(residual);
}

}  // namespace quadrig
