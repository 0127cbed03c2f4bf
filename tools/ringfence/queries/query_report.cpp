#include "queries/query_report.hpp"

#include <fmt/format.h>

namespace ringfence::tools {
namespace {

double per_query(const QueryWork& work, std::uint64_t count) {
  return work.queries == 0 ? 0 : static_cast<double>(count) / static_cast<double>(work.queries);
}

}  // namespace

void print_queries(std::FILE* out, const Figures& figures) {
  if (!figures.queries) return;
  const QueryFigures& queries = *figures.queries;
  const QueryWork& work = queries.work;
  fmt::print(out, "queries     {:.1f} per frame, {:.1f} hits; {:.1f} boxes and {:.2f} tests per query; {:.3f} ms\n",
             figures.mean(static_cast<double>(work.queries)), figures.mean(static_cast<double>(queries.hits)),
             per_query(work, work.boxes), per_query(work, work.tests), figures.mean(queries.ms));
  if (work.failed_supports > 0) {
    fmt::print(out, "queries     a support function failed in {} tests, which have no hit\n", work.failed_supports);
  }
  fmt::print(out, "answers     {} in total, digest {}\n", queries.hits, answer_digest(figures));
}

nlohmann::ordered_json queries_json(const Figures& figures) {
  const QueryFigures& queries = *figures.queries;
  return {{"total", queries.work.queries},
          {"hits", queries.hits},
          {"boxes", queries.work.boxes},
          {"tests", queries.work.tests},
          {"failed_supports", queries.work.failed_supports},
          {"ms", figures.mean(queries.ms)}};
}

std::string answer_digest(const Figures& figures) { return fmt::format("{:016x}", figures.queries->digest.value()); }

}  // namespace ringfence::tools
