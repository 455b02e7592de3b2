#include "duet/execution/missing_tags.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/plan/shipped_suites.h"

namespace duet {
namespace {

// The tags of the rows' clips, from their suite and the ids that it gives.
class ClipTags {
 public:
  ClipTags(const Suite& suite, const std::vector<EpisodeRow>& rows)
      : both_(suite.clips.roles == ClipRoles::kBoth), twins_(suite.clips.synth_per_file > 0) {
    for (const EpisodeRow& row : rows) own_role_.emplace(row.clip, row.clip);
    synthetic_ = synthetic_clips(suite.tasks, suite.clips);
    if (!both_) return;
    for (const auto& [id, tags] : synthetic_) take_roles(id);
    for (const auto& [id, same] : std::map<std::string, std::string>(own_role_))
      if (id == own_role_.at(id)) take_roles(id);
  }

  [[nodiscard]] Tags of(const std::string& clip) const {
    const std::string& own = own_role_.at(clip);
    const auto synthetic = synthetic_.find(own);
    Tags tags = synthetic == synthetic_.end() ? Tags() : synthetic->second;
    if (synthetic == synthetic_.end() && twins_) tags.emplace(kPeopleTag, kRecordedPeople);
    if (own != clip) tags.emplace(kRecordingTag, own);
    return tags;
  }

 private:
  // The rows of the clip's other role are of the clip, whichever person it is of.
  void take_roles(const std::string& id) {
    for (const char before : {'A', 'B'}) {
      const std::string other = id_in_other_role(id, before);
      const auto found = own_role_.find(other);
      if (found != own_role_.end() && !synthetic_.contains(other)) found->second = id;
    }
  }

  bool both_, twins_;  // files have synthesised clips beside them
  std::map<std::string, std::string> own_role_;
  std::map<std::string, Tags> synthetic_;
};

bool lacks_tags(const EpisodeRow& row) { return row.tags.empty(); }

template <typename Item>
void take_tags(const std::vector<Item>& from, std::vector<Item>& into) {
  for (Item& item : into)
    if (const auto same = std::ranges::find(from, item.name, &Item::name); item.tags.empty() && same != from.end())
      item.tags = same->tags;
}

// The run's, with the tags of the suite that ships where it is that one: tags are no part of a suite's hash, and one
// that ships may have more of them by now.
Suite suite_with_tags(const RunInfo& info) {
  Suite suite = parse_run_suite(info.suite_yaml, info.suite_file);
  try {
    if (const std::optional<Suite> shipped = shipped_suite_of(info)) {
      take_tags(shipped->perturbations, suite.perturbations);
      take_tags(shipped->references, suite.references);
    }
  } catch (const std::exception&) {  // none of the suites that ship, or one whose files are not here
  }
  return suite;
}

}  // namespace

bool add_missing_tags(const RunInfo& info, std::vector<EpisodeRow>& rows) {
  if (std::ranges::none_of(rows, lacks_tags)) return true;
  std::map<std::tuple<std::string, std::string, std::string>, RowTags> known;
  try {
    const Suite suite = suite_with_tags(info);
    const ClipTags clips(suite, rows);
    for (EpisodeRow& row : rows) {
      if (!lacks_tags(row)) continue;
      const auto [found, is_new] = known.try_emplace({row.perturbation, row.clip, row.policy});
      if (is_new) {
        const SuiteReference* command = suite.is_commanded() ? &reference_of(suite.references, row.clip) : nullptr;
        Tags tags = with_named_tags(tags_of(suite.perturbation(row.perturbation)),
                                    command == nullptr ? suite.policy(row.policy) : SuitePolicy(), command);
        tags.merge(clips.of(row.clip));
        found->second = RowTags(std::move(tags));
      }
      row.tags = found->second;
    }
  } catch (const std::exception&) {  // a suite of another program, or of other files than are here
    return false;
  }
  return true;
}

void add_missing_tags(Run& run) {
  if (add_missing_tags(run.info, run.rows)) return;
  run.warnings.push_back(fmt::format(
      "'{}': rows have no tags, and the run keeps no suite that gives them: tables say nothing of sizes of "
      "perturbations, levels, trainings, variants and who is recorded, and take the two roles of a clip for two clips",
      run.path));
}

}  // namespace duet
