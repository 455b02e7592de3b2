#include "duet/motion/layouts/joint_recipes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>
#include <set>
#include <unordered_map>

#include "duet/core/names.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {
namespace {

// Places of SMPL's joints that others lack, as parts of the way from pelvis to
// neck, and lengths in metres: those of the table in docs/file-formats.md
// ("People of fewer joints"), taken from SMPL's mean shape.
constexpr double kCollarAt = 0.81;
constexpr double kPelvisOverHips = 0.05, kNeckOverShoulders = 0.04, kHandBeyondWrist = 0.08;
constexpr double kHeadToTop = 0.4;   // head joint on the way from neck to the top of the head
constexpr double kHeadToEars = 0.8;  // and to the middle of the ears

using Words = std::map<std::string, int, std::less<>>;

const Words& words_by_joint() {
  static const Words words = {
      {"hip", kHipPart},         {"knee", kKneePart},     {"ankle", kAnklePart},       {"toe", kToePart},
      {"toes", kToePart},        {"toebase", kToePart},   {"bigtoe", kToePart},        {"collar", kCollarPart},
      {"clavicle", kCollarPart}, {"thorax", kCollarPart}, {"shoulder", kShoulderPart}, {"elbow", kElbowPart},
      {"wrist", kWristPart},     {"hand", kHandPart},     {"palm", kHandPart},         {"middle1", kHandPart},
      {"ear", kEarPart},         {"foot", kAnklePart},    {"middle0", kHandPart}};
  return words;
}

const Words& words_by_bone() {
  static const Words words = {
      {"upleg", kHipPart},          {"thigh", kHipPart},         {"upperleg", kHipPart},   {"leg", kKneePart},
      {"lowerleg", kKneePart},      {"shin", kKneePart},         {"calf", kKneePart},      {"foot", kAnklePart},
      {"toebase", kToePart},        {"toe", kToePart},           {"ball", kToePart},       {"shoulder", kCollarPart},
      {"collar", kCollarPart},      {"clavicle", kCollarPart},   {"arm", kShoulderPart},   {"uparm", kShoulderPart},
      {"upperarm", kShoulderPart},  {"forearm", kElbowPart},     {"lowerarm", kElbowPart}, {"hand", kWristPart},
      {"handmiddle1", kHandPart},   {"ear", kEarPart},           {"toes", kToePart},       {"toe0", kToePart},
      {"shldr", kShoulderPart},     {"femur", kHipPart},         {"tibia", kKneePart},     {"humerus", kShoulderPart},
      {"radius", kElbowPart},       {"wrist", kWristPart},       {"palm", kHandPart},      {"thighbend", kHipPart},
      {"shldrbend", kShoulderPart}, {"forearmbend", kElbowPart}, {"hip", kHipPart},        {"knee", kKneePart},
      {"ankle", kAnklePart},        {"elbow", kElbowPart}};
  return words;
}

struct SidedName {
  int side = 0;  // 0 left, 1 right
  std::string part;
};

// Letters and digits in lower case.
std::string plain(std::string_view name) {
  std::string text;
  for (const char c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

// "leftwrist", "wristleft", "lwrist", "wristl".
std::optional<SidedName> sided_name(const std::string& text, const Words& words) {
  for (const auto& [word, side] : {std::pair<std::string, int>{"left", 0}, {"right", 1}, {"l", 0}, {"r", 1}}) {
    const auto known = [&](const std::string& part) { return words.find(part) != words.end(); };
    if (text.starts_with(word) && known(text.substr(word.size()))) return SidedName{side, text.substr(word.size())};
    if (text.ends_with(word) && known(text.substr(0, text.size() - word.size())))
      return SidedName{side, text.substr(0, text.size() - word.size())};
  }
  return std::nullopt;
}

bool is_one_of(const std::string& name, std::initializer_list<const char*> names) {
  return std::any_of(names.begin(), names.end(), [&](const char* known) { return name == known; });
}

class ColumnFinder {
 public:
  ColumnFinder(const std::string& skeleton, const std::vector<std::string>& names)
      : skeleton_(skeleton), given_(names) {
    for (const std::string& name : without_prefix(names)) names_.push_back(plain(name));
    for (auto& side : found_.side) side.fill(-1);
    by_bone_ = has_sided({"forearm", "lowerarm", "radius", "forearmbend"});
    has_shin_ = has_sided({"shin"});
    has_ankle_ = has_sided({"ankle"});
    has_wrist_ = has_sided({"wrist"});
  }

  BodyColumns find() {
    for (std::size_t column = 0; column < names_.size(); ++column) {
      const auto at = static_cast<int>(column);
      if (const auto name = sided_name(names_[column], by_bone_ ? words_by_bone() : words_by_joint()))
        put_sided(*name, at);
      else
        put_middle(names_[column], at);
    }
    if (found_.neck < 0) found_.neck = second_neck_;
    if (by_bone_ && second_hips_ >= 0 && found_.pelvis < 0) found_.pelvis = second_hips_;
    std::stable_sort(trunk_.begin(), trunk_.end());
    for (const auto& [level, column] : trunk_) found_.trunk.push_back(column);
    return found_;
  }

 private:
  // "leftshin", "lshin", "shinleft", "shinl".
  [[nodiscard]] bool has_sided(std::initializer_list<std::string> parts) const {
    return std::any_of(parts.begin(), parts.end(), [&](const std::string& part) {
      return std::any_of(names_.begin(), names_.end(), [&](const std::string& name) {
        return name == "left" + part || name == "l" + part || name == part + "left" || name == part + "l";
      });
    });
  }

  void put(int& place, int column, const std::string& what) const {
    if (place >= 0)
      throw InputError(fmt::format("skeleton '{}': columns {} ('{}') and {} ('{}') are both the {}", excerpt(skeleton_),
                                   place, excerpt(given_[place]), column, excerpt(given_[column]), what));
    place = column;
  }

  void put_sided(const SidedName& name, int column) {
    int part = (by_bone_ ? words_by_bone() : words_by_joint()).find(name.part)->second;
    if (by_bone_ && has_shin_ && name.part == "leg") part = kHipPart;  // SOMA's Leg, Shin, Foot
    if (!by_bone_ && name.part == "foot" && has_ankle_) part = kToePart;
    if (by_bone_ && name.part == "hand" && has_wrist_) part = kHandPart;  // Wrist, Hand
    int& place = found_.side[name.side][part];
    // A joint's name among bones' stands for the part only where no bone does.
    const bool loose = by_bone_ && is_one_of(name.part, {"hip", "knee", "ankle", "elbow"});
    if (loose && place >= 0) return;
    if (!loose && is_loose_[name.side][part]) place = -1;
    is_loose_[name.side][part] = loose;
    // A knuckle stands for the hand only where there is no hand.
    const bool knuckle = name.part.ends_with('1') || name.part.ends_with('0');
    if (part == kHandPart && place >= 0 && knuckle) return;
    if (part == kHandPart && place >= 0 && is_knuckle_[name.side]) place = -1;
    is_knuckle_[name.side] = is_knuckle_[name.side] || knuckle;
    put(place, column, fmt::format("{} {}", name.side == 0 ? "left" : "right", name.part));
  }

  void put_middle(const std::string& name, int column) {
    if (is_one_of(name, {"pelvis", "hips", "root", "spinebase", "hipcenter", "midhip", "centerhip"}))
      return put(found_.pelvis, column, "pelvis");
    if (name == "hip") return put(second_hips_, column, "pelvis");
    if (is_one_of(name, {"head"})) return put(found_.head, column, "head");
    if (is_one_of(name, {"headtop", "headend", "vertex", "headnub"})) return put(found_.head_top, column, "head top");
    if (name == "nose") return put(found_.nose, column, "nose");
    if (name == "neck" || name == "lowerneck") return put(found_.neck, column, "neck");
    if (is_one_of(name, {"neck1", "shouldercenter", "spineshoulder", "thorax", "c7"})) {
      if (second_neck_ < 0) second_neck_ = column;  // the lowest of several
      return;
    }
    if (const auto level = trunk_level(name)) trunk_.emplace_back(*level, column);
  }

  // From below; "spine", "spine1", ... and "chest", "chest2", ... are chains of
  // their own, the chest above; vertebrae by what Xsens calls them.
  static std::optional<int> trunk_level(const std::string& name) {
    static const std::map<std::string, int> kLevels = {{"spinemid", 0}, {"abdomen", 0},    {"lowerback", 0},
                                                       {"l5", 1},       {"l3", 2},         {"t12", 3},
                                                       {"t8", 20},      {"upperback", 19}, {"upperchest", 2000}};
    if (const auto found = kLevels.find(name); found != kLevels.end()) return found->second;
    for (const auto& [word, base] : {std::pair<std::string, int>{"spine", 1}, {"chest", 1000}}) {
      if (!name.starts_with(word)) continue;
      const std::string number = name.substr(word.size());
      if (number.empty()) return base;
      if (number.size() <= 3 && std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; }))
        return base + 1 + std::stoi(number);
    }
    return std::nullopt;
  }

  const std::string& skeleton_;
  const std::vector<std::string>& given_;
  std::vector<std::string> names_;  // in plain letters
  BodyColumns found_;
  bool by_bone_ = false, has_shin_ = false, has_ankle_ = false, has_wrist_ = false;
  std::array<std::array<bool, kBodyPartCount>, 2> is_loose_ = {};
  std::array<bool, 2> is_knuckle_ = {false, false};
  int second_neck_ = -1, second_hips_ = -1;
  std::vector<std::pair<int, int>> trunk_;
};

using Part = JointRecipe::Part;

class RecipeMaker {
 public:
  RecipeMaker(const BodyColumns& columns, int size) : columns_(columns), size_(size) {}

  std::array<JointRecipe, kSmplJoints> make() {
    make_side(0);
    make_side(1);
    make_head_and_pelvis();
    make_spine();
    for (const SmplJoint shoulder : {kLeftShoulder, kRightShoulder}) make_collar(shoulder);
    return recipes_;
  }

 private:
  [[nodiscard]] int made(SmplJoint joint) const { return size_ + joint; }
  void take(int joint, int column) { recipes_[joint] = {.parts = {{column, 1.0}}}; }
  // At `part` of the way from one to the other.
  void take_between(int joint, int from, int to, double part) {
    recipes_[joint] = {.parts = {{from, 1.0 - part}, {to, part}}};
  }
  [[nodiscard]] std::vector<Part> ears(double weight) const {
    const int left = columns_.side[0][kEarPart], right = columns_.side[1][kEarPart];
    return {{left, 0.5 * weight}, {right, 0.5 * weight}};
  }
  [[nodiscard]] bool has_ears() const { return columns_.side[0][kEarPart] >= 0 && columns_.side[1][kEarPart] >= 0; }

  void make_side(int side) {
    const auto smpl = [&](SmplJoint left) { return side == 0 ? left : static_cast<SmplJoint>(kSmplMirror[left]); };
    const auto& at = columns_.side[side];
    take(smpl(kLeftHip), at[kHipPart]);
    take(smpl(kLeftKnee), at[kKneePart]);
    take(smpl(kLeftAnkle), at[kAnklePart]);
    take(smpl(kLeftShoulder), at[kShoulderPart]);
    take(smpl(kLeftElbow), at[kElbowPart]);
    if (at[kToePart] >= 0)
      take(smpl(kLeftToe), at[kToePart]);
    else
      recipes_[smpl(kLeftToe)] = {.parts = {{at[kAnklePart], 1.0}}, .ahead = kToeAhead, .down = kToeBelow};
    const int wrist = at[kWristPart] >= 0 ? at[kWristPart] : at[kHandPart],
              hand = at[kHandPart] >= 0 ? at[kHandPart] : at[kWristPart];
    take(smpl(kLeftWrist), wrist);
    take(smpl(kLeftHand), hand);
    if (wrist != hand) return;
    const int moved = at[kWristPart] < 0 ? smpl(kLeftWrist) : smpl(kLeftHand);
    const double outwards = at[kWristPart] < 0 ? -1.0 : 1.0;
    recipes_[moved].toward = {{hand, outwards}, {at[kElbowPart], -outwards}};
    recipes_[moved].reach = kHandBeyondWrist;
  }

  void make_head_and_pelvis() {
    const int left = columns_.side[0][kShoulderPart], right = columns_.side[1][kShoulderPart];
    std::vector<Part> top = has_ears()               ? ears(1.0)
                            : columns_.head >= 0     ? std::vector<Part>{{columns_.head, 1.0}}
                            : columns_.head_top >= 0 ? std::vector<Part>{{columns_.head_top, 1.0}}
                                                     : std::vector<Part>{{columns_.nose, 1.0}};
    if (columns_.neck >= 0) {
      take(kNeck, columns_.neck);
    } else {
      recipes_[kNeck] = {.parts = {{left, 0.5}, {right, 0.5}}, .toward = top, .reach = kNeckOverShoulders};
      recipes_[kNeck].toward.insert(recipes_[kNeck].toward.end(), {{left, -0.5}, {right, -0.5}});
    }
    if (columns_.head >= 0) {
      take(kHead, columns_.head);
    } else {
      const double part = has_ears() ? kHeadToEars : columns_.head_top >= 0 ? kHeadToTop : 1.0;
      for (Part& each : top) each.weight *= part;
      if (part < 1.0) top.push_back({made(kNeck), 1.0 - part});
      recipes_[kHead] = {.parts = top};
    }
    if (columns_.pelvis >= 0) return take(kPelvis, columns_.pelvis);
    const int left_hip = columns_.side[0][kHipPart], right_hip = columns_.side[1][kHipPart];
    recipes_[kPelvis] = {.parts = {{left_hip, 0.5}, {right_hip, 0.5}},
                         .toward = {{made(kNeck), 1.0}, {left_hip, -0.5}, {right_hip, -0.5}},
                         .reach = kPelvisOverHips};
  }

  void make_spine() {
    const std::vector<int>& trunk = columns_.trunk;
    const std::array<SmplJoint, 3> spine = {kSpine1, kSpine2, kSpine3};
    if (trunk.empty()) {
      for (std::size_t i = 0; i < 3; ++i) take_between(spine[i], made(kPelvis), made(kNeck), kSpineAt[i]);
    } else if (trunk.size() == 1) {
      take_between(kSpine1, made(kPelvis), trunk[0], kSpineAt[0] / kSpineAt[1]);
      take(kSpine2, trunk[0]);
      take_between(kSpine3, trunk[0], made(kNeck), (kSpineAt[2] - kSpineAt[1]) / (1.0 - kSpineAt[1]));
    } else {
      take(kSpine1, trunk.front());
      if (trunk.size() == 2)
        take_between(kSpine2, trunk[0], trunk[1], 0.5);
      else
        take(kSpine2, trunk[(trunk.size() - 1) / 2]);
      take(kSpine3, trunk.back());
    }
  }

  void make_collar(SmplJoint shoulder) {
    const int side = shoulder == kLeftShoulder ? 0 : 1;
    const SmplJoint collar = side == 0 ? kLeftCollar : kRightCollar;
    if (columns_.side[side][kCollarPart] >= 0) return take(collar, columns_.side[side][kCollarPart]);
    recipes_[collar] = {.parts = {{made(kPelvis), 1.0 - kCollarAt},
                                  {made(kNeck), kCollarAt - kCollarOut},
                                  {columns_.side[side][kShoulderPart], kCollarOut}}};
  }

  const BodyColumns& columns_;
  int size_;
  std::array<JointRecipe, kSmplJoints> recipes_;
};

}  // namespace

void require_parts(const BodyColumns& columns, const std::string& skeleton) {
  std::vector<std::string> missing;
  for (const int side : {0, 1}) {
    const auto need = [&](bool there, const char* part) {
      if (!there) missing.push_back(fmt::format("{} {}", side == 0 ? "left" : "right", part));
    };
    const auto& at = columns.side[side];
    need(at[kHipPart] >= 0, "hip");
    need(at[kKneePart] >= 0, "knee");
    need(at[kAnklePart] >= 0, "ankle (or foot)");
    need(at[kShoulderPart] >= 0, "shoulder");
    need(at[kElbowPart] >= 0, "elbow");
    need(at[kWristPart] >= 0 || at[kHandPart] >= 0, "wrist (or hand)");
  }
  const bool ears = columns.side[0][kEarPart] >= 0 && columns.side[1][kEarPart] >= 0;
  if (columns.head < 0 && columns.head_top < 0 && columns.nose < 0 && !ears)
    missing.emplace_back("head (or ears, nose, head top)");
  if (!missing.empty())
    throw InputError(
        fmt::format("skeleton '{}': no column is the {}", excerpt(skeleton), fmt::join(missing, "; none the ")));
}

bool lacks_legs(const BodyColumns& columns) {
  const auto& [left, right] = columns.side;
  for (const auto& at : columns.side)
    if (at[kKneePart] >= 0 || at[kAnklePart] >= 0 || at[kToePart] >= 0) return false;
  return (left[kHipPart] < 0) == (right[kHipPart] < 0);
}

BodyColumns body_columns(const std::string& skeleton, const std::vector<std::string>& names) {
  return ColumnFinder(skeleton, names).find();
}

std::array<JointRecipe, kSmplJoints> recipes_of(const BodyColumns& columns, int size, const std::string& skeleton) {
  require_parts(columns, skeleton);
  return RecipeMaker(columns, size).make();
}

std::vector<JointRecipe::Part> face_of(const BodyColumns& columns) {
  const int left = columns.side[0][kEarPart], right = columns.side[1][kEarPart];
  if (columns.nose < 0 || left < 0 || right < 0) return {};
  return {{columns.nose, 1.0}, {left, -0.5}, {right, -0.5}};
}

namespace {

constexpr std::string_view kSeparators = " _.-|";
constexpr std::size_t kLongestPrefix = 256;  // characters; more is no prefix of joints' names

std::string after_colon(const std::string& name) {
  const std::size_t colon = name.rfind(':');
  return colon == std::string::npos ? name : name.substr(colon + 1);
}

// Every beginning of a name up to a separator, shortest first.
std::vector<std::string_view> prefixes_of(std::string_view name) {
  std::vector<std::string_view> prefixes;
  name = name.substr(0, kLongestPrefix);
  for (std::size_t at = name.find_first_of(kSeparators); at != std::string_view::npos;
       at = name.find_first_of(kSeparators, at + 1))
    prefixes.push_back(name.substr(0, at + 1));
  return prefixes;
}

// The longest prefix that four of five names have. A root may be called as the prefix of the others is ("Bip01",
// "Bip01 Pelvis").
std::string_view shared_prefix(const std::vector<std::string>& names) {
  std::unordered_map<std::string_view, int> having, called;
  for (const std::string& name : names) {
    ++called[name];
    for (const std::string_view prefix : prefixes_of(name)) ++having[prefix];
  }
  std::string_view longest;
  for (const auto& [prefix, count] : having) {
    const auto root = called.find(prefix.substr(0, prefix.size() - 1));
    const std::ptrdiff_t sharing = count + (root == called.end() ? 0 : root->second);
    const bool longer = prefix.size() > longest.size() || (prefix.size() == longest.size() && prefix < longest);
    if (longer && 5 * sharing >= 4 * std::ssize(names)) longest = prefix;
  }
  return longest;
}

// "LeftHand" in quotes or not, without the comment behind it.
std::string plain_value(std::string_view text) {
  text = trimmed(text);
  if (text.size() > 1 && (text.front() == '"' || text.front() == '\''))
    if (const std::size_t end = text.find(text.front(), 1); end != std::string_view::npos)
      return std::string(text.substr(1, end - 1));
  return std::string(trimmed(text.substr(0, text.find(" #"))));
}

}  // namespace

std::vector<std::string> without_prefix(const std::vector<std::string>& names) {
  std::vector<std::string> plain;
  plain.reserve(names.size());
  for (const std::string& name : names) plain.push_back(after_colon(name));
  const std::string longest(shared_prefix(plain));
  if (longest.empty()) return plain;
  for (std::string& name : plain)
    if (name.size() > longest.size() && name.starts_with(longest)) name.erase(0, longest.size());
  return plain;
}

std::optional<JointNameMap> parse_joint_name_map(std::string_view text, const std::string& file) {
  if (text.find(':') == std::string_view::npos) return std::nullopt;
  const std::vector<std::string> known(kSmplNames.begin(), kSmplNames.end());
  JointNameMap map;
  std::set<std::string> joints;
  int number = 0;
  for (const std::string_view whole : split(text, '\n')) {
    ++number;
    const std::string_view line = trimmed(whole);
    if (line.empty() || line.front() == '#' || line == "---") continue;
    const auto refuse = [&](const std::string& fault) {
      throw InputError(fmt::format("'{}': line {}: {}", excerpt(file, kShownSentence), number, fault));
    };
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) refuse(fmt::format("expected 'left_hip: NAME', found '{}'", excerpt(line)));
    const std::string joint(trimmed(line.substr(0, colon))), name = plain_value(line.substr(colon + 1));
    if (std::find(known.begin(), known.end(), joint) == known.end())
      refuse(unknown_name_message("joint", joint, known));
    if (name.empty()) refuse(fmt::format("expected the name of '{}' in the motion file, found none", joint));
    if (!joints.insert(joint).second) refuse(fmt::format("joint '{}' is there twice", joint));
    if (!map.emplace(name, joint).second) refuse(fmt::format("'{}' is there twice", excerpt(name)));
  }
  return map;
}

std::vector<std::string> mapped(const JointNameMap& map, const std::vector<std::string>& names,
                                const std::string& file) {
  std::vector<std::string> joints;
  for (const std::string& name : names) {
    const auto found = map.find(name);
    joints.push_back(found == map.end() ? "" : found->second);
  }
  for (const auto& [name, joint] : map)
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw InputError(
          fmt::format("'{}': no joint '{}', which the skeleton file names as the {}. It "
                      "has: {}",
                      excerpt(file, kShownSentence), excerpt(name), joint,
                      excerpt(fmt::format("{}", fmt::join(names, ", ")), kShownSentence)));
  return joints;
}

}  // namespace duet
