// What a map makes of the directions and sizes that it was asked for.
#pragma once

namespace quadrig {

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
