#pragma once

#include <vector>

namespace ringfence::tools {

/// Median of `values`; 0 if there are none.
double median(std::vector<double> values);

}  // namespace ringfence::tools
