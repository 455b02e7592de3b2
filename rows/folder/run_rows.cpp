#include "duet/rows/folder/run_rows.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

std::string episode_label(const EpisodeRow& row) {
  return fmt::format("{} {} of {}/{}/{} {}", row.clip, row.episode, row.engine, row.controller, row.policy,
                     row.perturbation);
}

}  // namespace

RunRows::RunRows(std::string path, const RunInfo& info, RowExtent extent)
    : path_(std::move(path)), suite_(suite_label(info)), suite_hash_(info.suite_hash), extent_(extent) {
  digests_.add(info, "run.json");
}

EpisodeRow RunRows::parse(std::string_view line) const {
  EpisodeRow row =
      extent_ == RowExtent::kLean ? row_without_traces(line) : row_from_json(parse_json(line, "episode row"));
  if (const std::string key = episode_key(row); row.key != key)
    throw InputError(
        fmt::format("key 'key': expected {}, of what the row says, found {}: the row was changed", key, row.key));
  if (row.suite_hash != suite_hash_)
    throw InputError(fmt::format("the row is of suite {}, the run of {}",
                                 suite_label(row.suite, row.suite_version, row.suite_hash), suite_));
  return row;
}

void RunRows::add(EpisodeRow row, std::int64_t line_at) {
  digests_.add(row, line_place());
  if (extent_ == RowExtent::kLean) make_lean(row, line_at);
  share_names(row, pool_);
  if (const auto known = place_of_key_.find(row.key); known != place_of_key_.end())
    return add_again(std::move(row), known->second);
  rows_.push_back(std::move(row));
  place_of_key_.emplace(rows_.back().key, rows_.size() - 1);
  lines_.push_back(line_);
}

void RunRows::add(std::string_view text, std::int64_t text_at) {
  std::vector<std::string_view> lines;
  for (std::size_t begin = 0, end = 0; (end = text.find('\n', begin)) != std::string_view::npos; begin = end + 1)
    lines.push_back(text.substr(begin, end - begin));
  struct Parsed {
    EpisodeRow row;
    std::string error;
  };
  std::vector<Parsed> parsed(lines.size());
  parallel_for_each(static_cast<int>(lines.size()), default_threads(), [&](int i) {
    try {
      parsed[i].row = parse(lines[i]);
    } catch (const InputError& error) {
      parsed[i].error = error.what();
    }
  });
  for (std::size_t i = 0; i < lines.size(); ++i) {
    ++line_;
    if (!parsed[i].error.empty()) throw InputError(fmt::format("{}: {}", line_place(), parsed[i].error));
    add(std::move(parsed[i].row), text_at + (lines[i].data() - text.data()));
  }
}

void RunRows::add_again(EpisodeRow row, std::size_t place) {
  EpisodeRow& before = rows_[place];
  if (const Stands stands = which_stands(before.outcome, row.outcome); stands != Stands::kBothAgreed) {
    ++superseded_;
    if (stands == Stands::kFirst) return;
    std::swap(row.key, before.key);  // the same text where it was
    before = std::move(row);
    lines_[place] = line_;
    return;
  }
  if (extent_ == RowExtent::kLean) {
    needs_whole_rows_ = true;
    return;
  }
  if (const auto differences = row_differences(before, row); !differences.empty())
    throw InputError(
        fmt::format("{}: episode {} is already in line {} and differs ({}): remove the line that is "
                    "wrong, or both and the same run makes it again",
                    line_place(), episode_label(row), lines_[place], differences_text(differences)));
  ++equal_;
}

RunRows read_run_rows(const std::string& path, const RunInfo& info, bool* torn, RowExtent extent) {
  RunRows rows(path, info, extent);
  if (torn != nullptr) *torn = false;
  if (!std::filesystem::exists(path)) return rows;
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("cannot read '{}'", path));
  std::string rest;
  std::int64_t read = 0;  // bytes before `rest`
  std::string block(1 << 22, '\0');
  while (file.read(block.data(), static_cast<std::streamsize>(block.size())), file.gcount() > 0) {
    rest.append(block.data(), static_cast<std::size_t>(file.gcount()));
    const std::size_t whole = rest.rfind('\n') + 1;  // 0 where there is none
    rows.add(std::string_view(rest).substr(0, whole), read);
    rest.erase(0, whole);
    read += static_cast<std::int64_t>(whole);
    if (static_cast<std::int64_t>(rest.size()) > kMostTextBytes)
      throw InputError(fmt::format("{}: expected rows of at most {} bytes, found more", path, kMostTextBytes));
  }
  if (file.bad()) throw InputError(fmt::format("cannot read '{}' to its end", path));
  if (torn != nullptr) *torn = !rest.empty();
  if (rows.needs_whole_rows()) return read_run_rows(path, info, torn);
  return rows;
}

}  // namespace duet
