#include "duet/results/rows/run_rows.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/results/rows/json_fields.h"
#include "duet/results/rows/row_identity.h"

namespace duet {
namespace {

std::string episode_label(const EpisodeRow& row) {
  return fmt::format("{} {} of {}/{}/{} {}", row.clip, row.episode, row.engine, row.controller, row.policy,
                     row.perturbation);
}

}  // namespace

RunRows::RunRows(std::string path, const RunInfo& info)
    : path_(std::move(path)), suite_(suite_label(info)), suite_hash_(info.suite_hash) {
  digests_.add(info, "run.json");
}

void RunRows::add(std::string_view line) {
  const std::string where = fmt::format("{}:{}", path_, ++line_);
  EpisodeRow row = [&] {
    try {
      return row_from_json(parse_json(line, "episode row"));
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", where, error.what()));
    }
  }();
  if (const std::string key = episode_key(row); row.key != key)
    throw InputError(fmt::format("{}: key 'key': expected {}, of what the row says, found {}: the row was changed",
                                 where, key, row.key));
  if (row.suite_hash != suite_hash_)
    throw InputError(fmt::format("{}: the row is of suite {}, the run of {}", where,
                                 suite_label(row.suite, row.suite_version, row.suite_hash), suite_));
  digests_.add(row, where);
  const auto [known, is_new] = place_of_key_.try_emplace(row.key, rows_.size());
  if (!is_new) return add_again(std::move(row), known->second);
  rows_.push_back(std::move(row));
  lines_.push_back(line_);
}

void RunRows::add_again(EpisodeRow row, std::size_t place) {
  EpisodeRow& before = rows_[place];
  if (const Stands stands = which_stands(before.outcome, row.outcome); stands != Stands::kBothAgreed) {
    ++superseded_;
    if (stands == Stands::kFirst) return;
    before = std::move(row);
    lines_[place] = line_;
    return;
  }
  if (const auto differences = row_differences(before, row); !differences.empty())
    throw InputError(
        fmt::format("{}:{}: episode {} is already in line {} and differs ({}): remove the line that is "
                    "wrong, or both and the same run makes it again",
                    path_, line_, episode_label(row), lines_[place], differences_text(differences)));
  ++equal_;
}

RunRows read_run_rows(const std::string& path, const RunInfo& info, bool* torn) {
  RunRows rows(path, info);
  if (torn != nullptr) *torn = false;
  if (!std::filesystem::exists(path)) return rows;
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("cannot read '{}'", path));
  std::string rest;
  std::string block(1 << 20, '\0');
  while (file.read(block.data(), static_cast<std::streamsize>(block.size())), file.gcount() > 0) {
    rest.append(block.data(), static_cast<std::size_t>(file.gcount()));
    std::size_t begin = 0;
    for (std::size_t end = rest.find('\n'); end != std::string::npos; end = rest.find('\n', begin)) {
      rows.add(std::string_view(rest).substr(begin, end - begin));
      begin = end + 1;
    }
    rest.erase(0, begin);
    if (static_cast<std::int64_t>(rest.size()) > kMostTextBytes)
      throw InputError(fmt::format("{}: expected rows of at most {} bytes, found more", path, kMostTextBytes));
  }
  if (file.bad()) throw InputError(fmt::format("cannot read '{}' to its end", path));
  if (torn != nullptr) *torn = !rest.empty();
  return rows;
}

}  // namespace duet
