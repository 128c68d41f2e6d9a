// What a map makes of the directions and sizes that it was asked for.
#pragma once

#include <string>

#include "quadrig/core.hpp"

namespace quadrig {

/// What `reduce_curl` made of a field.
struct CurlReport {
  Index rounds = 0;  ///< taken
  /// FieldCurl of the frames, a number over a length; of a component of quads times a side of a mean quad.
  double mean_before = 0, mean_after = 0, largest_before = 0, largest_after = 0;
  double turned_mean_degrees = 0, turned_p95_degrees = 0;  ///< of both directions, either way; over the area, the faces
  double scaled_mean = 0, scaled_p95 = 0;                  ///< |ln| of both densities over those wanted, likewise
  std::string backend;                                     ///< what solved, in words; empty where nothing was to

  /// With lengths measured in another unit. \param unit the new one in the old
  [[nodiscard]] CurlReport in_units_of(double unit) const {
    CurlReport result = *this;
    for (const auto curl :
         {&CurlReport::mean_before, &CurlReport::mean_after, &CurlReport::largest_before, &CurlReport::largest_after})
      result.*curl *= unit;
    return result;
  }
};

/// Means and percentiles over the faces. A map is the gradient of two functions, a field with sizes is not: by as much
/// as the field has curl, the map has to turn it and to change its sizes.
struct MapStrain {
  /// Mean over the area and largest of a face, |curl| / |density| times a side of a mean quad: the share by which the
  /// size of a quad and its neighbour's disagree.
  double curl_mean = 0, curl_largest = 0;
  double turned_mean_degrees = 0, turned_p95_degrees = 0;  ///< of both directions together, either way
  double scaled_mean = 0, scaled_p95 = 0;                  ///< |ln| of the side of a quad over that asked for
};

}  // namespace quadrig
