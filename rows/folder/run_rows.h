// episodes.jsonl as rows: which of several rows of one episode stands. Rows are only ever appended; equal rows of two
// processes count once, errors and time-outs give way (rows/row_file.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "duet/core/named_values.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/folder/run_info.h"

namespace duet {

// Whole rows, or of each what tables are made of (rows/row_file.h).
enum class RowExtent { kWhole, kLean };

class RunRows {
 public:
  // `path` stands in messages. The rows must be of the suite of `info`.
  RunRows(std::string path, const RunInfo& info, RowExtent extent = RowExtent::kWhole);

  // Whole lines, each with its newline; they begin at the byte `text_at` of the file. Throws InputError: a broken row,
  // a key that is not the row's, a row of another suite or of another policy or controller under one name, a row that
  // differs from an earlier one of its episode (both lines, the fields, what to do).
  void add(std::string_view text, std::int64_t text_at);

  [[nodiscard]] const std::vector<EpisodeRow>& rows() const { return rows_; }
  [[nodiscard]] std::vector<EpisodeRow> take() { return std::move(rows_); }
  // Rows left out because an equal one is there, and errors and time-outs that another row stands for.
  [[nodiscard]] int equal() const { return equal_; }
  [[nodiscard]] int superseded() const { return superseded_; }
  // Whether rows would have to be compared that are held lean: the file has to be read again, whole.
  [[nodiscard]] bool needs_whole_rows() const { return needs_whole_rows_; }

 private:
  [[nodiscard]] EpisodeRow parse(std::string_view line) const;
  [[nodiscard]] std::string line_place() const { return path_ + ":" + std::to_string(line_); }
  void add(EpisodeRow row, std::int64_t line_at);
  void add_again(EpisodeRow row, std::size_t place);

  std::string path_, suite_, suite_hash_;
  RowExtent extent_;
  bool needs_whole_rows_ = false;
  NamePool pool_;
  IdentityCheck digests_;
  int line_ = 0, equal_ = 0, superseded_ = 0;
  std::vector<EpisodeRow> rows_;                                    // in file order
  std::vector<int> lines_;                                          // of each, from 1
  std::unordered_map<std::string_view, std::size_t> place_of_key_;  // of keys in rows_, whose text never moves
};

// All rows of a file (lean ones that would have to be compared: whole), and whether its last line lacks its newline (it
// is then left out). No file: no rows.
RunRows read_run_rows(const std::string& path, const RunInfo& info, bool* torn = nullptr,
                      RowExtent extent = RowExtent::kWhole);

}  // namespace duet
