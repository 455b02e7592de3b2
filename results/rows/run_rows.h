// episodes.jsonl as rows: which of several rows of one episode stands. Rows are only ever appended; equal rows of two
// processes count once, errors and time-outs give way (results/rows/row_identity.h).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "duet/results/rows/episode_row.h"
#include "duet/results/rows/name_digests.h"
#include "duet/results/rows/run_info.h"

namespace duet {

class RunRows {
 public:
  // `path` stands in messages. The rows must be of the suite of `info`.
  RunRows(std::string path, const RunInfo& info);

  // One line without its newline. Throws InputError: a broken row, a key that is not the row's, a row of another suite
  // or of another policy or controller under one name, a row that differs from an earlier one of its episode (both
  // lines, the fields, what to do).
  void add(std::string_view line);

  [[nodiscard]] const std::vector<EpisodeRow>& rows() const { return rows_; }
  [[nodiscard]] std::vector<EpisodeRow> take() { return std::move(rows_); }
  // Rows left out because an equal one is there, and errors and time-outs that another row stands for.
  [[nodiscard]] int equal() const { return equal_; }
  [[nodiscard]] int superseded() const { return superseded_; }

 private:
  void add_again(EpisodeRow row, std::size_t place);

  std::string path_, suite_, suite_hash_;
  NameDigests digests_;
  int line_ = 0, equal_ = 0, superseded_ = 0;
  std::vector<EpisodeRow> rows_;  // in file order
  std::vector<int> lines_;        // of each, from 1
  std::unordered_map<std::string, std::size_t> place_of_key_;
};

// All rows of a file, and whether its last line lacks its newline (it is then left out). No file: no rows.
RunRows read_run_rows(const std::string& path, const RunInfo& info, bool* torn = nullptr);

}  // namespace duet
