#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "output_file.hpp"
#include "queries/frame_answers.hpp"
#include "queries/query_figures.hpp"
#include "queries/query_load.hpp"

namespace ringfence::tools {

/// Asks the queries of a run after each counted frame, and writes the answers (--answers). Without queries it does
/// nothing, and the World pins no frame.
class FrameQueries {
 public:
  /// `load` must outlive the object. Throws Error if the file of the answers cannot be opened.
  explicit FrameQueries(const QueryLoad& load);

  /// To be called after each counted frame. `frame` is its number in the files, from 0. Throws IncompleteError if the
  /// world refuses a query.
  void add_frame(std::uint32_t frame, const World& world);
  /// Writes the rest and closes the file. Throws IncompleteError if that fails.
  void finish();

  /// The queries of the last frame, and their answers.
  std::span<const worlds::QueryRow> rows() const noexcept { return rows_; }
  const FrameAnswers& answers() const noexcept { return answers_; }
  /// Of all frames so far; empty if the run has no queries.
  const std::optional<QueryFigures>& figures() const noexcept { return figures_; }

 private:
  void select_rows(std::uint32_t frame);
  void write_answers();

  const QueryLoad& load_;
  std::optional<OutputFile> file_;
  std::size_t next_ = 0;                  ///< index in load_.rows of the first row that was not asked
  std::vector<worlds::QueryRow> random_;  ///< of --rays
  std::span<const worlds::QueryRow> rows_;
  FrameAnswers answers_;
  std::optional<QueryFigures> figures_;
};

}  // namespace ringfence::tools
