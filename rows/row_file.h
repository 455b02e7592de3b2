// Rows by the million: what no table reads - traces, contacts, digests that were checked, what verdicts are of - stays
// in the file, and is read where it stands when a figure asks for it. Thread-safe.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "duet/rows/episode_row.h"
#include "duet/core/named_values.h"

namespace duet {

// A line of episodes.jsonl without its traces and contacts, which are not looked into. One frame stands for all of a
// foot trace. Throws InputError as row_from_json.
EpisodeRow row_without_traces(std::string_view line);
// Gives up what no table reads; the line begins at `line_at`.
void make_lean(EpisodeRow& row, std::int64_t line_at);
// A row's tags, and its names of metrics, forces and of what verdicts are of, become those of the pool.
void share_names(EpisodeRow& row, NamePool& pool);

// Where rows that were held lean stand.
class RowFile {
 public:
  RowFile() = default;  // of rows that are whole
  // Throws InputError where it cannot be read.
  explicit RowFile(std::string path);

  // The row's own, or those of its line. Throw InputError: the file is not what it was when the row was read.
  [[nodiscard]] StateTrace trace(const EpisodeRow& row) const;
  [[nodiscard]] FootTrace feet(const EpisodeRow& row) const;

 private:
  struct Open;
  [[nodiscard]] std::string line_of(const EpisodeRow& row) const;

  std::string path_;
  std::shared_ptr<const Open> open_;  // shared: copies of the object read one file
};

}  // namespace duet
