// The checklist before a robot is armed, as a form that somebody fills in: docs/hardware.md, "From gantry to person".
// It is one robot's, for the bytes of one configuration and one card, and grows old. Pure functions.
#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

enum class ChecklistValue { kNone, kNumber, kText };

struct ChecklistItem {
  std::string_view name, step;  // what has to be done, and what is to be written down
  ChecklistValue value = ChecklistValue::kNone;
  double least = 0.0;  // of a number
};

// In the order in which they are done: none before those above it.
inline constexpr std::size_t kChecklistItems = 8;
inline constexpr std::array<ChecklistItem, kChecklistItems> kChecklist = {
    {{"spotter", "a spotter holds a hardware emergency stop throughout; their name", ChecklistValue::kText},
     {"twin", "./run test has passed, and every fault of the twin was seen once"},
     {"gantry", "off its feet on the gantry: duet hw check, joints and keys as on the robot; the mode_machine",
      ChecklistValue::kNumber},
     {"dry_run", "duet hw dry-run on the gantry, and duet replay-log on its log; minutes, 10 or more",
      ChecklistValue::kNumber, 10.0},
     {"commands_end", "on the gantry, limp: commands were ended (cable, guard); what the robot did",
      ChecklistValue::kText},
     {"stops",
      "stop key, dead-man switch and emergency stop each ended a motion of the arms; how often each, 10 or more",
      ChecklistValue::kNumber, 10.0},
     {"feet", "feet on the ground, gantry slack, nobody within 3 m: stance, then walking with short durations"},
     {"dummy", "reach, touch and release of a dummy with a force gauge, at a signed table's limits; largest force [N]",
      ChecklistValue::kNumber}}};
std::vector<std::string> checklist_names();

struct ChecklistAnswer {
  bool done = false;
  std::string value;  // "" where the item has none
};

struct Checklist {
  std::string robot;                // its serial number, as the configuration names it
  std::string who;                  // filled it in
  std::string when;                 // "2026-11-28T10:15Z"
  double at = 0.0;                  // the same, since 1970 [s]
  std::string configuration, card;  // SHA-256 of the configuration's file, and of the robot's card
  std::array<ChecklistAnswer, kChecklistItems> answers;
};

// A configuration's demand of a form.
struct ChecklistDemand {
  std::string form;        // its path; empty: none is asked for
  double hours = 12.0;     // for which it is good
  std::string up_to = {};  // the last item that has to be done; empty: all
  bool required = false;   // without it nothing is armed; otherwise it is warned about
};

// A form to fill in (YAML): every item is not done. `now`: since 1970 [s].
std::string empty_checklist(const std::string& robot, const std::string& configuration, const std::string& card,
                            double now);
// Throw InputError with file, line, expected and found: an item that is missing or not known, done without its value or
// before one above it, a number below its least, a time of another form.
Checklist parse_checklist(const std::string& text, const std::string& file);
Checklist read_checklist(const std::string& path);

// Why the form does not do, as one sentence: another robot, configuration or card, too old or of the future, an item
// that is not done; empty where it does. `now`: since 1970 [s].
std::string checklist_refusal(const Checklist& form, const ChecklistDemand& demand, const std::string& robot,
                              const std::string& configuration, const std::string& card, double now);

// As a log keeps it.
nlohmann::json checklist_json(const Checklist& form);

}  // namespace duet
