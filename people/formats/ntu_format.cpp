// NTU RGB+D's ".skeleton" files (Shahroudy et al. 2016, Liu et al. 2019: 60 and
// 120 actions), as text: how many frames; for each how many bodies; for each
// body a line of ten numbers that begins with its id, how many joints (25), and
// a line a joint: x, y, z [m] in the camera's axes (y up), its places in the
// images, an orientation, and how it is tracked (0 not, 1 inferred, 2 tracked).
// 30 Hz.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/people_format.h"

namespace duet {
namespace {

constexpr int kNtuJoints = 25;
constexpr double kNtuRate = 30.0;
constexpr int kMostNtuBodies = 64;
constexpr std::size_t kBodyFields = 10, kJointFields = 12;
constexpr std::int64_t kMostNtuBytes = std::int64_t{1} << 28;

// The actions of two people, by the number after "A" in the file's name.
const std::map<int, const char*>& ntu_actions() {
  static const std::map<int, const char*> actions = {{50, "punching"},
                                                     {51, "kicking"},
                                                     {52, "pushing"},
                                                     {53, "patting on the back"},
                                                     {54, "pointing"},
                                                     {55, "hugging"},
                                                     {56, "giving something"},
                                                     {57, "touching a pocket"},
                                                     {58, "shaking hands"},
                                                     {59, "walking towards"},
                                                     {60, "walking apart"},
                                                     {106, "hitting with something"},
                                                     {107, "wielding"},
                                                     {108, "knocking over"},
                                                     {109, "grabbing"},
                                                     {110, "shooting"},
                                                     {111, "stepping on a foot"},
                                                     {112, "high five"},
                                                     {113, "cheers and drink"},
                                                     {114, "carrying together"},
                                                     {115, "taking a photo"},
                                                     {116, "following"},
                                                     {117, "whispering"},
                                                     {118, "exchanging things"},
                                                     {119, "supporting"},
                                                     {120, "rock-paper-scissors"}};
  return actions;
}

// "S001C003P008R002A058": 58.
std::string ntu_label(const std::string& stem) {
  const std::size_t at = stem.rfind('A');
  const std::optional<double> number =
      at == std::string::npos ? std::nullopt : parse_number(std::string_view(stem).substr(at + 1));
  const auto known = number ? ntu_actions().find(static_cast<int>(*number)) : ntu_actions().end();
  return known == ntu_actions().end() ? "" : known->second;
}

using NtuPose = std::array<Eigen::Vector3d, kNtuJoints>;

struct NtuBody {
  std::string id;
  std::map<int, NtuPose> poses;  // by the frame
};

class NtuLines {
 public:
  NtuLines(std::string_view text, const std::string& name) : rest_(text), name_(name) {}

  [[noreturn]] void fail(const std::string& fault) const {
    throw InputError(fmt::format("'{}': line {}: {}", excerpt(name_, kShownSentence), number_, fault));
  }

  // The fields of the next line that has any.
  std::vector<std::string_view> next(std::size_t least, const char* what) {
    std::vector<std::string_view> fields;
    while (fields.empty() && !rest_.empty()) {
      const std::size_t end = std::min(rest_.find('\n'), rest_.size());
      for (const std::string_view field : split(trimmed(rest_.substr(0, end)), ' '))
        if (const std::string_view text = trimmed(field); !text.empty()) fields.push_back(text);
      rest_.remove_prefix(std::min(end + 1, rest_.size()));
      ++number_;
    }
    if (fields.size() < least) fail(fmt::format("expected {}, found {} fields", what, fields.size()));
    return fields;
  }

  double number(std::string_view field) const {
    if (const std::optional<double> value = parse_number(field)) return *value;
    if (field == "nan" || field == "NaN") return std::numeric_limits<double>::quiet_NaN();
    fail(fmt::format("expected a number, found '{}'", excerpt(field)));
  }

  int count(const char* what, int most) {
    const double value = number(next(1, what)[0]);
    if (!(value >= 0.0 && value <= most && value == std::floor(value)))
      fail(fmt::format("expected {} of 0 to {}, found {}", what, most, value));
    return static_cast<int>(value);
  }

 private:
  std::string_view rest_;
  const std::string& name_;
  int number_ = 0;
};

NtuPose read_pose(NtuLines& lines) {
  if (const int joints = lines.count("the number of joints", 1000); joints != kNtuJoints)
    lines.fail(fmt::format("expected {} joints, found {}", kNtuJoints, joints));
  NtuPose pose;
  for (Eigen::Vector3d& joint : pose) {
    const auto fields = lines.next(3, "a joint: x, y, z and nine more numbers");
    for (int axis = 0; axis < 3; ++axis) joint[axis] = lines.number(fields[axis]);
    const bool lost = fields.size() >= kJointFields && lines.number(fields[kJointFields - 1]) == 0.0;
    if (lost) joint.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return pose;
}

std::vector<NtuBody> read_bodies(const std::string& text, const std::string& name) {
  NtuLines lines(text, name);
  std::vector<NtuBody> bodies;
  const int frames = lines.count("the number of frames", 10'000'000);
  for (int t = 0; t < frames; ++t)
    for (int left = lines.count("the number of bodies", kMostNtuBodies); left > 0; --left) {
      const std::string id(lines.next(kBodyFields, "a body: its id and nine more numbers")[0]);
      auto body = std::find_if(bodies.begin(), bodies.end(), [&](const NtuBody& known) { return known.id == id; });
      if (body == bodies.end()) body = bodies.insert(body, {.id = id, .poses = {}});
      if (!body->poses.emplace(t, read_pose(lines)).second) lines.fail("this body is twice in one frame");
    }
  return bodies;
}

// The two that are seen longest, in the order in which they appear.
std::array<NtuBody, 2> two_of(std::vector<NtuBody> bodies, const std::string& name) {
  if (bodies.size() < 2)
    throw InputError(fmt::format("'{}': expected two people, found {} (an action of one person?)",
                                 excerpt(name, kShownSentence), bodies.size()));
  while (bodies.size() > 2) {  // the shortest, the last of several
    const auto shortest = std::min_element(bodies.rbegin(), bodies.rend(), [](const NtuBody& a, const NtuBody& b) {
      return a.poses.size() < b.poses.size();
    });
    bodies.erase(std::next(shortest).base());
  }
  return {std::move(bodies[0]), std::move(bodies[1])};
}

bool is_ntu_name(const std::string& name) { return name.ends_with(".skeleton"); }

bool recognises_ntu(std::span<const std::string> paths) {
  return !paths.empty() && std::all_of(paths.begin(), paths.end(), [](const std::string& path) {
    return !first_file_at(path, is_ntu_name).empty();
  });
}

std::vector<ClipPlace> find_ntu(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  return clips_at(paths, is_ntu_name, "ntu");
}

RawPeople read_ntu(const ClipPlace& place, const PeopleOptions& /*options*/) {
  const std::string& file = place.files.at(0);
  std::vector<NtuBody> bodies = read_bodies(read_plain_text(file, kMostNtuBytes), file);
  const std::size_t found = bodies.size();
  const std::array<NtuBody, 2> two = two_of(std::move(bodies), file);
  const int first = std::max(two[0].poses.begin()->first, two[1].poses.begin()->first);
  const int last = std::min(two[0].poses.rbegin()->first, two[1].poses.rbegin()->first);
  if (last <= first)
    throw InputError(fmt::format("'{}': the two people are never seen at once", excerpt(file, kShownSentence)));
  RawPeople people{.id = place.id, .name = file, .layout = &joint_layout("ntu-25"), .joints = {}};
  for (const std::size_t who : {0U, 1U}) {
    people.joints[who] = PointTracks(last - first + 1, kNtuJoints);
    for (double& value : people.joints[who].data()) value = std::numeric_limits<double>::quiet_NaN();
    for (const auto& [t, pose] : two[who].poses)
      if (t >= first && t <= last)
        for (int j = 0; j < kNtuJoints; ++j) people.joints[who].at(t - first, j) = pose[static_cast<std::size_t>(j)];
  }
  people.rate_hz = kNtuRate;
  people.metres_per_unit = 1.0;
  people.evidence.push_back(
      fmt::format("people: bodies {} and {}{}, both in frames {} to {}", excerpt(two[0].id), excerpt(two[1].id),
                  found > 2 ? fmt::format(" of {}, which are seen longest", found) : "", first, last));
  people.source = {{"format", "ntu"}, {"file_a", file}};
  if (const std::string label = ntu_label(stem_of(file)); !label.empty()) {
    people.source["label"] = label;
    people.task = task_of_label(label);
  }
  return people;
}

}  // namespace

PeopleFormat ntu_format() {
  return {.name = "ntu",
          .what = "NTU RGB+D: .skeleton files of two bodies (25 joints of a Kinect)",
          .licence = "NTU RGB+D: academic research only",
          .recognises = recognises_ntu,
          .find = find_ntu,
          .read = read_ntu};
}

}  // namespace duet
