// What every other header shares: indices, errors as values, and a callback that does not allocate.
#pragma once

#if (defined(_MSVC_LANG) ? _MSVC_LANG : __cplusplus) < 202002L
// A file that is missing ends the compilation: one line in place of hundreds.
#define QUADRIG_NEEDS_CXX20 "quadrig needs C++20: compile with -std=c++20 (g++ 12, clang 14 or newer)"
#include QUADRIG_NEEDS_CXX20
#endif

#include <cassert>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

// Header-only unless QUADRIG_COMPILED is defined (by linking quadrig::compiled): then the large functions are only
// declared here and their one definition lives in the library.
#if defined(QUADRIG_COMPILED)
#define QUADRIG_INLINE
#else
#define QUADRIG_INLINE inline
#endif

namespace quadrig {

#if defined(QUADRIG_COMPILED)
/// Eigen takes and frees memory, and lays out its types, by EIGEN_MAX_ALIGN_BYTES, which options like -mavx change, and
/// by whether malloc aligns enough, which -fsanitize=address changes. The library defines `check` for the values that
/// it was compiled with alone, and every program refers to that of its own: with others it does not link, in place of
/// crashing.
template <int bytes, int bytes_of_fixed_sizes, bool by_malloc>
struct library_was_compiled_with_another_EIGEN_MAX_ALIGN_BYTES {
  static void check();
};
namespace detail {
using SameAlignment =
    library_was_compiled_with_another_EIGEN_MAX_ALIGN_BYTES<EIGEN_DEFAULT_ALIGN_BYTES, EIGEN_MAX_STATIC_ALIGN_BYTES,
                                                            EIGEN_MALLOC_ALREADY_ALIGNED != 0>;
#if defined(__GNUC__)
[[gnu::used]]
#endif
static void (*const same_alignment)() = &SameAlignment::check;
}  // namespace detail
#endif

/// Numbers vertices, faces, half-edges, bones and unknowns. Faces are limited to 2^31 / 3.
using Index = std::int32_t;
inline constexpr Index no_index = -1;

using Complex = std::complex<double>;

namespace detail {
/// An index as containers of the standard library want it.
[[nodiscard]] constexpr std::size_t at(Index i) { return static_cast<std::size_t>(i); }
}  // namespace detail

/// n×3, one point a row, row major.
template <class Scalar>
using Points = Eigen::Matrix<Scalar, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// m×3, one triangle a row, counter-clockwise seen from outside.
using Triangles = Eigen::Matrix<Index, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// m×4, one quad a row, counter-clockwise seen from outside.
using Quads = Eigen::Matrix<Index, Eigen::Dynamic, 4, Eigen::RowMajor>;
using Vector3 = Eigen::Vector3d;

template <class T>
class Expected;

/// What kind of thing went wrong; the command turns each into its own exit code (docs/command.md).
enum class ErrorCode : std::uint8_t {
  bad_option,    ///< an option out of range or a combination that cannot be
  bad_file,      ///< a file that cannot be read or written
  bad_input,     ///< readable, but not a mesh, rig or weights this library can use
  unsupported,   ///< a sound request that this build or version cannot serve
  numeric,       ///< a factorization or an iteration failed
  stage_failed,  ///< a stage could not make a valid result
  cancelled,     ///< the caller asked to stop
};

/// A user's error: what was wrong, where (file, line, face, vertex, stage) and what to do about it.
struct Error {
  ErrorCode code = ErrorCode::bad_input;
  std::string what;
  std::string where;
  std::string remedy;

  /// One line: "where: what; remedy".
  [[nodiscard]] std::string message() const {
    std::string text = where.empty() ? what : where + ": " + what;
    return remedy.empty() ? text : text + "; " + remedy;
  }
};

/// A value or an Error. `value()` on an error is a broken precondition, never a thrown exception.
template <class T>
class [[nodiscard]] Expected {
 public:
  Expected(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Expected(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  [[nodiscard]] bool has_value() const { return state_.index() == 0; }
  explicit operator bool() const { return has_value(); }

  [[nodiscard]] T& value() & { return assert(has_value()), *std::get_if<0>(&state_); }
  [[nodiscard]] const T& value() const& { return assert(has_value()), *std::get_if<0>(&state_); }
  [[nodiscard]] T&& value() && { return assert(has_value()), std::move(*std::get_if<0>(&state_)); }
  [[nodiscard]] const Error& error() const& { return assert(!has_value()), *std::get_if<1>(&state_); }
  [[nodiscard]] Error&& error() && { return assert(!has_value()), std::move(*std::get_if<1>(&state_)); }

  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::variant<T, Error> state_;
};

/// Success or an Error.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Error error) : error_(std::move(error)) {}
  [[nodiscard]] bool ok() const { return !error_; }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] const Error& error() const { return assert(!ok()), *error_; }

 private:
  std::optional<Error> error_;
};

/// A borrowed callable: two words, no allocation. \pre what it refers to outlives it.
template <class Signature>
class function_ref;

template <class Result, class... Args>
class function_ref<Result(Args...)> {
 public:
  template <class F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, function_ref> && std::is_invocable_r_v<Result, F&, Args...>)
      function_ref(F&& f)
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(f)))),
        call_([](void* object, Args... args) -> Result {
          return (*static_cast<std::remove_reference_t<F>*>(object))(std::forward<Args>(args)...);
        }) {}
  Result operator()(Args... args) const { return call_(object_, std::forward<Args>(args)...); }

 private:
  void* object_;
  Result (*call_)(void*, Args...);
};

/// Any of Eigen's matrices or expressions.
template <class M>
concept EigenMatrix = std::is_base_of_v<Eigen::EigenBase<M>, M>;
/// One whose number of columns is only known as the program runs, as Eigen::MatrixXd. Functions that take Points,
/// Triangles or Quads and cannot fail are deleted for such: pass what `with_columns` returns.
template <class M>
concept RuntimeColumns = EigenMatrix<M> && int(M::ColsAtCompileTime) == Eigen::Dynamic;

/// A matrix whose number of columns is only known as the program runs, as one of `columns` columns: what functions
/// that take Points, Triangles or Quads need. Eigen checks that number in an assertion alone, and writes past the end
/// without it. \fails bad_input where the matrix has another number of columns: names it by `name`. \cost O(entries)
template <int columns, EigenMatrix Matrix>
[[nodiscard]] Expected<Eigen::Matrix<typename Matrix::Scalar, Eigen::Dynamic, columns, Eigen::RowMajor>> with_columns(
    const Matrix& matrix, const char* name) {
  static_assert(int(Matrix::ColsAtCompileTime) == columns || int(Matrix::ColsAtCompileTime) == Eigen::Dynamic,
                "another number of columns than this function needs");
  if (matrix.cols() != columns)
    return Error{ErrorCode::bad_input,
                 std::to_string(matrix.rows()) + " × " + std::to_string(matrix.cols()) + " in place of " +
                     std::to_string(columns) + " columns",
                 name, "give one row each, with " + std::to_string(columns) + " columns"};
  return Eigen::Matrix<typename Matrix::Scalar, Eigen::Dynamic, columns, Eigen::RowMajor>(matrix);
}

/// Something a stage repaired or could not honour; it is in the report, and the library never prints it.
struct Warning {
  std::string stage;
  std::string text;
};

}  // namespace quadrig
