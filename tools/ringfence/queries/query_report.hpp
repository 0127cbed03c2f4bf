#pragma once

#include <cstdio>
#include <string>

#include <nlohmann/json.hpp>

#include "figures.hpp"

namespace ringfence::tools {

/// Prints the lines of the report about queries, if the run has any.
void print_queries(std::FILE* out, const Figures& figures);

/// The value of `queries` in the JSON report.
nlohmann::ordered_json queries_json(const Figures& figures);

/// The digest of the answers, 16 hexadecimal digits. Precondition: the run has queries.
std::string answer_digest(const Figures& figures);

}  // namespace ringfence::tools
