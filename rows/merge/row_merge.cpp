#include "duet/rows/merge/row_merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <queue>
#include <set>
#include <unordered_set>

#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/rows/folder/run_info.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/merge/merge_files.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

// Sorts as the tuple of its parts: no part holds a zero byte.
std::string merge_place(const EpisodeRow& row) {
  const std::string episode = fmt::format("{:010}", row.episode);
  std::string place;
  for (const std::string* part : {&row.engine, &row.controller, &row.perturbation, &row.arm, &row.policy, &row.task,
                                  &row.clip, &episode, &row.key}) {
    place += *part;
    place += '\0';
  }
  return place;
}

// The error of the first source that has one, whatever thread reads it.
class MergeFailure {
 public:
  void note(std::size_t source) {
    const std::lock_guard lock(mutex_);
    if (source < source_) error_ = std::current_exception();
    source_ = std::min(source_, source);
  }
  // Whether a source before this one has failed: what comes after it is not looked at.
  bool before(std::size_t source) {
    const std::lock_guard lock(mutex_);
    return source_ < source;
  }
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::mutex mutex_;
  std::size_t source_ = std::numeric_limits<std::size_t>::max();
  std::exception_ptr error_;
};

// Reads sources, one after the other, and sorts what it has found of them a budget at a time. One thread.
class MergeIndexer {
 public:
  MergeIndexer(const std::vector<RowSource>& sources, const RunInfo& info, std::size_t budget, std::string scratch)
      : sources_(sources), info_(info), budget_(budget), scratch_(std::move(scratch)) {}

  void read(std::size_t source) {
    LineFile lines(sources_[source].path);
    while (const std::optional<std::string_view> line = lines.next()) {
      add(static_cast<std::uint32_t>(source), *line, lines);
      if (entries_.size() >= budget_) spill();
    }
    torn_ += lines.torn() ? 1 : 0;
  }
  [[nodiscard]] int torn() const { return torn_; }
  // Rows that name something for the first time here, with their source.
  [[nodiscard]] const std::map<std::uint32_t, std::vector<EpisodeRow>>& naming() const { return naming_; }

  // Sorted pieces, each an own stream, behind those that are there.
  void finish(std::vector<std::unique_ptr<EntryStream>>& streams) {
    std::ranges::sort(entries_, is_before);
    streams_.push_back(std::make_unique<EntryStream>(std::move(entries_)));
    std::ranges::move(streams_, std::back_inserter(streams));
  }

 private:
  void add(std::uint32_t source, std::string_view line, const LineFile& lines) {
    const auto where = [&] { return fmt::format("{}:{}", sources_[source].path, lines.line()); };
    try {
      scan_row(line, scanned_);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", where(), error.what()));
    }
    const EpisodeRow& row = scanned_.row;
    if (row.suite_hash != info_.suite_hash)
      throw InputError(fmt::format("{}: the row is of suite {}, the run of {}", where(),
                                   suite_label(row.suite, row.suite_version, row.suite_hash), suite_label(info_)));
    note_names(row, source);
    entries_.push_back({.place = merge_place(row),
                        .fingerprint = scanned_.fingerprint,
                        .started_at = row.started_at,
                        .source = source,
                        .length = static_cast<std::uint32_t>(line.size()),
                        .offset = lines.offset(),
                        .outcome = row.outcome});
  }

  // A million rows name a dozen of things.
  void note_names(const EpisodeRow& row, std::uint32_t source) {
    std::string said;
    for (const std::string* part :
         {&row.policy, &row.policy_digest, &row.controller, &row.controller_digest, &row.engine, &row.profile_digest}) {
      said += *part;
      said += '\0';
    }
    said += row.outcome == Outcome::kUnsupported ? '0' : '1';
    if (seen_.insert(std::move(said)).second) naming_[source].push_back(row);
  }

  void spill() {
    std::ranges::sort(entries_, is_before);
    streams_.push_back(std::make_unique<EntryStream>(scratch_, entries_));
    entries_.clear();
  }

  const std::vector<RowSource>& sources_;
  const RunInfo& info_;
  std::size_t budget_;
  std::string scratch_;
  ScannedRow scanned_;  // of the line before
  std::vector<RowEntry> entries_;
  std::vector<std::unique_ptr<EntryStream>> streams_;
  std::unordered_set<std::string> seen_;
  std::map<std::uint32_t, std::vector<EpisodeRow>> naming_;
  int torn_ = 0;
};

// Throws InputError where a name stands for two digests. In the order of the sources, whatever thread read them.
void check_digests(const std::vector<MergeIndexer>& indexers, const std::vector<RowSource>& sources) {
  IdentityCheck digests;
  for (std::uint32_t source = 0; source < sources.size(); ++source)
    for (const MergeIndexer& indexer : indexers)
      if (const auto found = indexer.naming().find(source); found != indexer.naming().end())
        for (const EpisodeRow& row : found->second) digests.add(row, sources[source].from);
}

// All sources, on all cores: each thread takes the next one and has its share of the budget.
std::vector<std::unique_ptr<EntryStream>> index_sources(const std::vector<RowSource>& sources, const RunInfo& info,
                                                        std::size_t budget, const std::string& scratch, int& torn) {
  constexpr int kMostThreads = 16;  // more of them than a disk can feed
  const int threads = std::clamp(static_cast<int>(sources.size()), 1, std::min(default_threads(), kMostThreads));
  MergeFailure failure;
  std::vector<MergeIndexer> indexers;
  indexers.reserve(threads);
  const std::size_t share = std::max<std::size_t>(budget / threads, 1);
  for (int i = 0; i < threads; ++i) indexers.emplace_back(sources, info, share, scratch);
  std::atomic<std::size_t> next{0};
  parallel_for_each(threads, threads, [&](int i) {
    for (std::size_t source = next++; source < sources.size(); source = next++) {
      if (failure.before(source)) return;
      try {
        indexers[i].read(source);
      } catch (...) {
        failure.note(source);
      }
    }
  });
  failure.rethrow();
  check_digests(indexers, sources);
  std::vector<std::unique_ptr<EntryStream>> streams;
  for (MergeIndexer& indexer : indexers) {
    torn += indexer.torn();
    indexer.finish(streams);
  }
  return streams;
}

// The entries of all streams in order, an episode's together.
class EntryGroups {
 public:
  explicit EntryGroups(std::vector<std::unique_ptr<EntryStream>> streams) : streams_(std::move(streams)) {
    for (std::size_t i = 0; i < streams_.size(); ++i)
      if (streams_[i]->next()) heads_.push(i);
  }

  // Empty at the end.
  std::vector<RowEntry> next() {
    std::vector<RowEntry> group;
    while (!heads_.empty()) {
      const std::size_t first = heads_.top();
      if (!group.empty() && streams_[first]->entry().place != group.front().place) break;
      heads_.pop();
      group.push_back(std::move(streams_[first]->entry()));
      if (streams_[first]->next()) heads_.push(first);
    }
    return group;
  }

 private:
  struct IsAfter {
    const std::vector<std::unique_ptr<EntryStream>>& streams;
    bool operator()(std::size_t a, std::size_t b) const { return is_before(streams[b]->entry(), streams[a]->entry()); }
  };
  std::vector<std::unique_ptr<EntryStream>> streams_;
  std::priority_queue<std::size_t, std::vector<std::size_t>, IsAfter> heads_{IsAfter{streams_}};
};

// Decides which row of an episode stands, and counts.
class MergeJudge {
 public:
  MergeJudge(const std::vector<RowSource>& sources, SourceFiles& files) : sources_(sources), files_(files) {}

  // The one that stands; of a group whose rows differ any of them.
  RowEntry judge(std::vector<RowEntry> group) {
    count_sources(group);
    const std::size_t before = group.size();
    leave_those_that_stand(group);
    merged_.superseded += static_cast<std::int64_t>(before - group.size());
    const Outcome outcome = group.front().outcome;
    std::ranges::sort(group, {}, [](const RowEntry& entry) { return std::pair(entry.source, entry.offset); });
    // Messages of errors may name places and times: those need not agree.
    if (which_stands(outcome, outcome) == Stands::kBothAgreed && group.size() > 1) compare(group);
    merged_.folded += static_cast<std::int64_t>(group.size()) - 1;
    ++merged_.rows;
    merged_.errors += outcome == Outcome::kError ? 1 : 0;
    merged_.timeouts += outcome == Outcome::kTimedOut ? 1 : 0;
    RowEntry stands = earliest(group);
    if (const std::string& node = sources_[stands.source].node; !node.empty()) ++merged_.of_node[node];
    return stands;
  }

  [[nodiscard]] MergedRows& merged() { return merged_; }

 private:
  static void leave_those_that_stand(std::vector<RowEntry>& group) {
    Outcome best = group.front().outcome;
    for (const RowEntry& entry : group)
      if (which_stands(best, entry.outcome) == Stands::kSecond) best = entry.outcome;
    std::erase_if(group, [&](const RowEntry& entry) { return which_stands(best, entry.outcome) == Stands::kFirst; });
  }

  void count_sources(const std::vector<RowEntry>& group) {
    std::set<int> runs, shards;
    for (const RowEntry& entry : group) {
      runs.insert(sources_[entry.source].run);
      shards.insert(sources_[entry.source].shard);
    }
    for (const int run : runs) ++merged_.of_run[run];
    for (const int shard : shards)
      if (shard >= 0) ++merged_.of_shard[shard];
  }

  // The first row against each other one; a differing pair of nodes counts once an episode.
  void compare(const std::vector<RowEntry>& group) {
    const RowEntry& first = group.front();
    std::set<NodePair> pairs, differing;
    bool any = false;
    for (std::size_t i = 1; i < group.size(); ++i) {
      const NodePair pair = std::minmax(sources_[first.source].node, sources_[group[i].source].node);
      const bool named = !pair.first.empty() && pair.first != pair.second;
      if (named) pairs.insert(pair);
      if (first.fingerprint == group[i].fingerprint) continue;
      const EpisodeRow a = full(first), b = full(group[i]);
      const std::vector<FieldDifference> differences = row_differences(a, b);
      if (differences.empty()) continue;
      if (named) differing.insert(pair);
      if (!any && merged_.conflicts.size() < kMostConflicts)
        merged_.conflicts.push_back(fmt::format("{} {} of {}/{}/{} {} is not the same in '{}' and '{}': {}", a.clip,
                                                a.episode, a.engine, a.controller, a.policy, a.perturbation,
                                                sources_[first.source].from, sources_[group[i].source].from,
                                                differences_text(differences)));
      any = true;
    }
    for (const NodePair& pair : pairs) ++merged_.agreement[pair].compared;
    for (const NodePair& pair : differing) ++merged_.agreement[pair].different;
    merged_.violations += any ? 1 : 0;
  }

  // Wall times are all that equal rows differ in.
  RowEntry earliest(const std::vector<RowEntry>& group) {
    const RowEntry* best = &group.front();
    std::string text;
    for (std::size_t i = 1; i < group.size(); ++i) {
      const RowEntry& other = group[i];
      if (other.started_at > best->started_at) continue;
      if (other.started_at == best->started_at && files_.read(other) >= (text = files_.read(*best))) continue;
      best = &other;
    }
    return *best;
  }

  EpisodeRow full(const RowEntry& entry) {
    try {
      return row_from_json(parse_json(files_.read(entry), "episode row"));
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", sources_[entry.source].path, error.what()));
    }
  }

  const std::vector<RowSource>& sources_;
  SourceFiles& files_;
  MergedRows merged_;
};

std::vector<std::string> paths_of(const std::vector<RowSource>& sources) {
  std::vector<std::string> paths;
  paths.reserve(sources.size());
  for (const RowSource& source : sources) paths.push_back(source.path);
  return paths;
}

}  // namespace

MergedRows merge_rows(const std::vector<RowSource>& sources, const RunInfo& info, const std::string& output,
                      const MergeBudget& budget) {
  int torn = 0;
  EntryGroups groups(index_sources(sources, info, budget.entries, output, torn));
  SourceFiles files(paths_of(sources));
  MergeJudge judge(sources, files);
  ReplacedFile result(output);
  for (std::vector<RowEntry> group = groups.next(); !group.empty(); group = groups.next()) {
    const RowEntry stands = judge.judge(std::move(group));
    if (judge.merged().violations == 0) files.read(stands, result.line(stands.length));
  }
  judge.merged().torn = torn;
  if (judge.merged().violations == 0) result.commit();
  return std::move(judge.merged());
}

}  // namespace duet
