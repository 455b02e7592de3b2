// Parts of an episode row beside texts and numbers: verdicts, contacts, traces, faults. Each part is one JSON
// object, declared once: its struct here and its members' table in row_objects.cpp.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/core/episode_facts.h"
#include "duet/core/episode_tags.h"
#include "duet/rows/json_members.h"

namespace duet {

// The verdict of one detector. Values and margins: NaN where undefined (null in JSON, as for any other that is not
// finite).
struct Verdict : DetectorFacts {
  std::string version;     // "paper", "robot", "interaction"
  std::string thresholds;  // "paper", "strict", "act"
  int frames = 0;          // number of evidence frames
};

// Tags of an episode (core/episode_tags.h). Rows that have the same share them.
class RowTags {
 public:
  RowTags() = default;
  explicit RowTags(Tags tags) : tags_(tags.empty() ? nullptr : std::make_shared<const Tags>(std::move(tags))) {}

  [[nodiscard]] bool empty() const { return tags_ == nullptr; }
  [[nodiscard]] const Tags& map() const;
  // "" where there is no such tag.
  [[nodiscard]] const std::string& text(std::string_view name) const;
  // NaN where there is no such tag, or it is no number.
  [[nodiscard]] double number(std::string_view name) const;
  // Takes the pool's map in the place of its own, which is the same.
  void share(NamePool& pool) {
    if (tags_) tags_ = pool.shared(tags_);
  }
  bool operator==(const RowTags& other) const { return map() == other.map(); }

 private:
  std::shared_ptr<const Tags> tags_;  // shared: nobody knows which of the rows lives longest; null: none
};

// Where a few points were, to tell when two engines part on one episode.
struct StateTrace {
  double rate_hz = 10.0;             // frame i is at i / rate_hz [s]
  std::vector<std::string> points;   // "root", "left_hand", "right_hand"
  std::vector<std::vector<int>> mm;  // per frame x, y, z of each point in turn [mm], frame W; empty: not recorded
};

// Height of the lowest point of each sole over the ground, of a robot whose controller walks.
struct FootTrace {
  double rate_hz = 25.0;               // frame i is at i / rate_hz [s]
  std::vector<int> left_mm, right_mm;  // as long as one another [mm]; empty: not recorded
};

// A contact as a row keeps it, by names.
struct RowContact : ContactFacts {
  std::string link, region, capsule;  // "left_wrist_yaw_link", "upper_arm", "right_upper_arm"
};

inline constexpr std::size_t kMostRowContacts = 16;

template <typename Part>
std::span<const JsonMember<Part>> part_members() = delete;
template <>
std::span<const JsonMember<Verdict>> part_members<Verdict>();
template <>
std::span<const JsonMember<StateTrace>> part_members<StateTrace>();
template <>
std::span<const JsonMember<ControllerFaults>> part_members<ControllerFaults>();
template <>
std::span<const JsonMember<PolicyFaults>> part_members<PolicyFaults>();
template <>
std::span<const JsonMember<PlanTimes>> part_members<PlanTimes>();
template <>
std::span<const JsonMember<FootTrace>> part_members<FootTrace>();
template <>
std::span<const JsonMember<RowContact>> part_members<RowContact>();

template <typename T>
concept RowPart = requires {
  part_members<T>();
};

// A trace without frames is null. Throw std::invalid_argument for a trace whose frames do not fit its points, and for
// feet of different lengths.
nlohmann::json json_value(const RowTags& tags, bool finite);
nlohmann::json json_value(const StateTrace& trace, bool finite);
nlohmann::json json_value(const FootTrace& feet, bool finite);
void read_value(JsonFields& fields, const std::string& key, bool finite, RowTags& tags);
void read_value(JsonFields& fields, const std::string& key, bool finite, StateTrace& trace);
void read_value(JsonFields& fields, const std::string& key, bool finite, FootTrace& feet);
std::string_view value_words(ValueType<RowTags>, bool finite);
std::string_view value_words(ValueType<StateTrace>, bool finite);
std::string_view value_words(ValueType<FootTrace>, bool finite);

template <RowPart Part>
nlohmann::json part_json(const Part& part) {
  nlohmann::json json = nlohmann::json::object();
  for (const JsonMember<Part>& known : part_members<Part>()) write_member(known, part, json);
  return json;
}

// `what`: of messages, "episode row: faults".
template <RowPart Part>
Part part_from_json(const nlohmann::json& json, const std::string& what) {
  JsonFields fields(json, what);
  Part part;
  for (const JsonMember<Part>& known : part_members<Part>()) read_member(known, fields, part);
  fields.refuse_unknown();
  return part;
}

template <RowPart Part>
nlohmann::json json_value(const Part& part, bool) {
  return part_json(part);
}
template <RowPart Part>
void read_value(JsonFields& fields, const std::string& key, bool, Part& part) {
  part = part_from_json<Part>(fields.at(key), fields.what() + ": " + key);
}
template <RowPart Part>
std::string_view value_words(ValueType<Part>, bool) {
  return "object";
}

template <RowPart Part>
nlohmann::json json_value(const std::vector<Part>& parts, bool) {
  nlohmann::json list = nlohmann::json::array();
  for (const Part& part : parts) list.push_back(part_json(part));
  return list;
}
// The key is a plural: one of "verdicts" is "verdict 0".
template <RowPart Part>
void read_value(JsonFields& fields, const std::string& key, bool, std::vector<Part>& parts) {
  parts.clear();
  for (const nlohmann::json& item : fields.list(key))
    parts.push_back(part_from_json<Part>(
        item, fields.what() + ": " + key.substr(0, key.size() - 1) + " " + std::to_string(parts.size())));
}
template <RowPart Part>
std::string_view value_words(ValueType<std::vector<Part>>, bool) {
  return "list of objects";
}

}  // namespace duet
