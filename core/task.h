// Which task an interaction is, and the three phases of each (supplement B.4). The supplement's six tasks (B.1) have
// names in code; every other is a row of tasks/list.cmake and is asked for by its name (docs/extending.md, "A task").
#pragma once

#include <array>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// A place in the list of tasks. The task's TaskDefinition says what it is (tasks/task_definition.h).
class Task {
 public:
  static const Task kHug, kHandshake, kHighFive, kWave, kBend, kFlyKiss;

  // In all_tasks().
  [[nodiscard]] constexpr int index() const { return index_; }
  constexpr auto operator<=>(const Task&) const = default;

 private:
  friend struct TaskList;
  constexpr explicit Task(int index) : index_(index) {}

  int index_;
};

inline constexpr Task Task::kHug{0};
inline constexpr Task Task::kHandshake{1};
inline constexpr Task Task::kHighFive{2};
inline constexpr Task Task::kWave{3};
inline constexpr Task Task::kBend{4};
inline constexpr Task Task::kFlyKiss{5};

// The six tasks of the supplement, in its order: what "all tasks" means in suites and commands, and what networks that
// were made before there was a seventh know.
inline constexpr std::array<Task, 6> kPaperTasks = {Task::kHug,  Task::kHandshake, Task::kHighFive,
                                                    Task::kWave, Task::kBend,      Task::kFlyKiss};

// Every task that there is: those of the supplement first, then the others as tasks/list.cmake has them.
std::span<const Task> all_tasks();

// "hug", "handshake", "high_five", ...: the names in files, messages and reports.
std::string_view to_string(Task task);
std::vector<std::string> task_names(std::span<const Task> tasks);

// Accepts '-' for '_'. Throws std::invalid_argument for an unknown name and lists the known ones, with the nearest
// first.
Task parse_task(std::string_view name);

enum class Phase { kPreparation, kAct, kFollowUp };
std::string_view to_string(Phase phase);  // "preparation", "act", "follow_up"

// Frames [0, act_begin) are preparation, [act_begin, act_end) act, [act_end, frames) follow-up.
struct Phases {
  int act_begin = 0;
  int act_end = 0;

  [[nodiscard]] Phase at(int frame) const {
    return frame < act_begin ? Phase::kPreparation : frame < act_end ? Phase::kAct : Phase::kFollowUp;
  }
  bool operator==(const Phases&) const = default;
};

// The role of an arm of a benchmark. Tables rank competitors; controls and oracles stand beside them as lines of
// reference. An arm says its role here, a policy where it is registered (policies/catalogue/registry.h).

enum class ArmRole {
  kCompetitor,
  kControl,  // what somebody reaches who does not do the task: the claim of a competitor is its lift over the best one
  kOracle    // knows what no competitor may know
};

struct PolicyRole {
  ArmRole role = ArmRole::kCompetitor;
  std::string_view word = "";  // of a reference, as it stands in brackets after its name: "knows the motion"
};

// Roles by the name that the suite gives a policy; one that is not there competes.
using PolicyRoles = std::map<std::string, PolicyRole>;

// The values of EpisodeRow::arm.
struct EpisodeArmInfo {
  std::string_view name;
  PolicyRole role;  // kCompetitor: that of the policy
};
inline constexpr std::array<EpisodeArmInfo, 4> kEpisodeArms = {
    {{"main", {}},
     {"null", {ArmRole::kControl, "stands still"}},
     {"control", {ArmRole::kControl, "scripted"}},
     {"shuffled", {ArmRole::kControl, "sees the partner of another clip"}}}};

// The role of an episode's arm and policy.
inline PolicyRole role_of(std::string_view arm, const std::string& policy, const PolicyRoles& policies) {
  for (const EpisodeArmInfo& known : kEpisodeArms)
    if (known.name == arm && known.role.role != ArmRole::kCompetitor) return known.role;
  const auto found = policies.find(policy);
  return found == policies.end() ? PolicyRole() : found->second;
}

// Values by name, as text, that tables know of an episode beside its names. A suite says them, or they follow from what
// it runs; a row holds them from where it is made. Names of perturbations, policies and clips are parsed by nobody.

using Tags = std::map<std::string, std::string, std::less<>>;

// In a row a tag's name begins with what it is of: "perturbation.", "clip." or "policy.".
inline constexpr std::string_view kOfPerturbation = "perturbation", kOfClip = "clip", kOfPolicy = "policy";
inline std::string row_tag(std::string_view of, std::string_view name) {
  return std::string(of).append(".").append(name);
}

// A perturbation's kinds ("push", "jitter+dropout"); where it is one value that is 0 in a clean episode, that
// value in SI units, its unit, which value it is ("push", "partner.shift_s"), and the other values of its kind.
inline constexpr std::string_view kKindsTag = "perturbation.kinds", kFamilyTag = "perturbation.family",
                                  kSizeTag = "perturbation.size", kUnitTag = "perturbation.unit",
                                  kBesideTag = "perturbation.beside";

// A perturbation that is one value, which is 0 in a clean episode: tables draw success over it.
struct PerturbationSize {
  std::string
      family;        // its kind ("jitter"), of a kind with several such values with the value's name: "partner.shift_s"
  double x = 0.0;    // in SI units
  std::string unit;  // "m", "s", ...; "" for none
  std::string beside;  // the kind's other values: "duration: 1, every: 4"
};

// A clip's tags: who its people are; the kinds of what was made up of them ("gaps+legs"); the clip that shows the same
// recording in the other role, where there is one before it; what a variant asks for.
inline constexpr std::string_view kPeopleTag = "clip.people", kMadeUpTag = "clip.made_up",
                                  kRecordingTag = "clip.recording", kSideTag = "clip.side",
                                  kHeightTag = "clip.target_height";
inline constexpr std::string_view kRecordedPeople = "recorded", kSyntheticPeople = "synthetic";

// That a suite sets and tables read: the rung of a ladder and its name, of perturbations and commands; what a policy is
// a training of, and the seed of that training.
inline constexpr std::string_view kMethodTag = "policy.method", kTrainingSeedTag = "policy.seed";

// Those that follow from what a suite runs: nobody may give them.
inline constexpr std::array<std::string_view, 10> kDerivedTags = {
    kKindsTag, kFamilyTag, kSizeTag, kUnitTag, kBesideTag, kPeopleTag, kMadeUpTag, kRecordingTag, kSideTag, kHeightTag};
// Those of which a table needs a whole number, by the name that a suite gives them, and how many digits it may have.
struct WholeTag {
  std::string_view name;
  std::size_t digits;
};
inline constexpr std::array<WholeTag, 3> kWholeTags = {{{"level", 6}, {"stage", 6}, {"seed", 18}}};

// How an episode or a step ended. Outcomes are values: they are counted as failures, shown, never dropped.

enum class Outcome { kOk, kFell, kDiverged, kTimedOut, kUnsupported, kError };

// "ok", "fell", "diverged", "timeout", "unsupported", "error".
std::string_view to_string(Outcome outcome);
// Throws std::invalid_argument for an unknown name.
Outcome parse_outcome(std::string_view name);

}  // namespace duet
