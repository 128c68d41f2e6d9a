// Hermitian matrices from Matrix Market files, for the benchmarks of solvers.
#pragma once

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>

#include "quadrig/sparse.hpp"

namespace quadrig::bench {

/// The lower triangle of a file "matrix coordinate real symmetric", or "complex hermitian"; a real one is read as
/// complex too. Entries that are missing on the diagonal are 0.
/// \fails bad_file, naming the line
inline Expected<HermitianMatrix<Complex>> read_matrix_market(const std::string& path) {
  std::ifstream in(path);
  std::string line, banner, object, format, field, symmetry;
  std::size_t number = 0;
  const auto fail = [&](std::string what) {
    return Error{ErrorCode::bad_file, std::move(what), path + ":" + std::to_string(number),
                 "give a Hermitian matrix in the coordinate format of Matrix Market"};
  };
  const auto next = [&] {
    while (std::getline(in, line)) {
      ++number;
      if (!line.empty() && line[0] != '%') return true;
    }
    return false;
  };
  if (!std::getline(in, line)) return fail("the file cannot be read");
  ++number;
  std::istringstream(line) >> banner >> object >> format >> field >> symmetry;
  const bool complex = field == "complex";
  if (banner != "%%MatrixMarket" || object != "matrix" || format != "coordinate" ||
      !((complex && symmetry == "hermitian") || (field == "real" && symmetry == "symmetric")))
    return fail("neither real symmetric nor complex hermitian");
  std::int64_t rows = 0, columns = 0, count = 0;
  if (!next() || !(std::istringstream(line) >> rows >> columns >> count) || rows != columns || rows < 1 ||
      rows > 0x7fffffff || count < 0)
    return fail("no size of a square matrix");
  struct Entry {
    Index column, row;
    Complex value;
  };
  std::vector<Entry> entries;
  for (std::int64_t k = 0; k < count; ++k) {
    std::int64_t i = 0, j = 0;
    double re = 0, im = 0;
    if (!next()) return fail("fewer entries than announced");
    std::istringstream words(line);
    if (!(words >> i >> j >> re) || (complex && !(words >> im)) || i < 1 || j < 1 || i > rows || j > rows)
      return fail("not an entry");
    if (i >= j)
      entries.push_back({static_cast<Index>(j - 1), static_cast<Index>(i - 1), {re, im}});
    else
      entries.push_back({static_cast<Index>(i - 1), static_cast<Index>(j - 1), {re, -im}});
  }
  for (Index i = 0; i < rows; ++i) entries.push_back({i, i, 0.0});
  std::stable_sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) {
    return a.column != b.column ? a.column < b.column : a.row < b.row;
  });
  HermitianMatrix<Complex> matrix;
  matrix.size = static_cast<Index>(rows);
  for (const Entry& entry : entries) {
    while (static_cast<Index>(matrix.column_starts.size()) <= entry.column)
      matrix.column_starts.push_back(static_cast<Index>(matrix.rows.size()));
    const bool same =
        static_cast<Index>(matrix.rows.size()) > matrix.column_starts.back() && matrix.rows.back() == entry.row;
    if (same) {
      matrix.values.back() += entry.value;
    } else {
      matrix.rows.push_back(entry.row);
      matrix.values.push_back(entry.value);
    }
  }
  matrix.column_starts.push_back(static_cast<Index>(matrix.rows.size()));
  return matrix;
}

}  // namespace quadrig::bench
