#include "duet/people/bvh/bvh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <numbers>

#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kMostJoints = 10'000;
constexpr std::size_t kShownWord = 40;
constexpr std::size_t kMostMotionBytes = std::size_t{1} << 30;  // hours of one person
const std::array<std::string_view, 6> kChannelNames = {"Xposition", "Yposition", "Zposition",
                                                       "Xrotation", "Yrotation", "Zrotation"};

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r'; }

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }

// Makers write keywords in upper, lower and mixed case.
bool same(std::string_view word, std::string_view keyword) {
  return std::equal(word.begin(), word.end(), keyword.begin(), keyword.end(),
                    [](char a, char b) { return lower(a) == lower(b); });
}

// Words of a text with the line that each stands on.
class Words {
 public:
  Words(std::string_view text, std::string name) : rest_(text), name_(std::move(name)) {}

  // The next word, "" at the end of the text.
  std::string_view next() {
    skip_blanks_and_lines();
    return take_word();
  }
  // The next word where it is this one; else nothing is taken.
  bool accept(std::string_view word) {
    const Words before = *this;
    if (same(next(), word)) return true;
    *this = before;
    return false;
  }
  // The text up to the end of the line or a brace: names of joints may have
  // blanks.
  std::string_view name() {
    skip_blanks_and_lines();
    return rest_of_name();
  }
  std::string_view rest_of_name() {
    const std::string_view text = rest_.substr(0, rest_.find_first_of("\n{"));
    rest_.remove_prefix(text.size());
    return trimmed(text);
  }
  // Goes past "Frames:", "Frames :", "frames:"; `words`: without the colon, one
  // blank between them.
  void label(std::string_view words, const std::string& where) {
    skip_blanks_and_lines();
    const Words before = *this;
    for (const char c : words) {
      if (c == ' ') {
        skip_blanks();
      } else if (!rest_.empty() && lower(rest_.front()) == lower(c)) {
        rest_.remove_prefix(1);
      } else {
        return before.refuse_label(words, where);
      }
    }
    skip_blanks();
    if (!rest_.starts_with(':')) return before.refuse_label(words, where);
    rest_.remove_prefix(1);
  }
  // The next word of the same line, "" at its end.
  std::string_view next_on_line() {
    skip_blanks();
    return take_word();
  }
  // Goes on to the next line that has a word; false at the end of the text.
  bool next_line() {
    const std::string_view before = next();
    if (before.empty()) return false;
    rest_ = {before.data(), before.size() + rest_.size()};
    return true;
  }

  void expect(std::string_view word, const std::string& where) { check(next(), word, where); }

  double number(std::string_view word, const std::string& what) const {
    double value = 0.0;
    const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc::result_out_of_range || (error == std::errc() && !std::isfinite(value)))
      fail(fmt::format("{}: '{}' is not finite", what, excerpt(word, kShownWord)));
    if (word.empty() || error != std::errc() || end != digits.data() + digits.size())
      fail(fmt::format("{}: expected a number, found {}", what, found(word)));
    return value;
  }

  void check(std::string_view word, std::string_view expected, const std::string& where) const {
    if (!same(word, expected)) fail(fmt::format("{}: expected '{}', found {}", where, expected, found(word)));
  }
  [[noreturn]] void fail(const std::string& fault) const {
    throw InputError(fmt::format("{}:{}: {}", name_, line_, excerpt(fault, kShownSentence)));
  }
  static std::string found(std::string_view word) {
    return word.empty() ? "the end of the text" : fmt::format("'{}'", excerpt(word, kShownWord));
  }

 private:
  void skip_blanks() {
    while (!rest_.empty() && is_space(rest_.front())) rest_.remove_prefix(1);
  }
  void skip_blanks_and_lines() {
    while (!rest_.empty() && (is_space(rest_.front()) || rest_.front() == '\n')) {
      line_ += rest_.front() == '\n';
      rest_.remove_prefix(1);
    }
  }
  void refuse_label(std::string_view words, const std::string& where) const {
    Words at = *this;
    fail(fmt::format("{}: expected '{}:', found {}", where, words, found(at.next())));
  }
  std::string_view take_word() {
    std::size_t size = 0;
    while (size < rest_.size() && !is_space(rest_[size]) && rest_[size] != '\n') ++size;
    const std::string_view word = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return word;
  }

  std::string_view rest_;
  std::string name_;
  int line_ = 1;
};

std::string channel_fault(std::string_view word) {
  if (word.empty()) return "expected a channel, found the end of the text";
  return unknown_name_message("channel", word, std::vector<std::string>(kChannelNames.begin(), kChannelNames.end()));
}

void read_offset(Words& words, BvhJoint& joint) {
  const std::string where = "OFFSET of '" + joint.name + "'";
  for (int axis = 0; axis < 3; ++axis) joint.offset[axis] = words.number(words.next(), where);
}

void read_channels(Words& words, BvhJoint& joint) {
  const std::string where = "CHANNELS of '" + joint.name + "'";
  const double count = words.number(words.next(), where);
  if (!(count >= 0.0 && count <= 6.0 && count == std::floor(count)))
    words.fail(fmt::format("{}: expected 0 to 6 channels, found {}", where, count));
  for (int i = 0; i < static_cast<int>(count); ++i) {
    const std::string_view word = words.next();
    const auto known = std::find_if(kChannelNames.begin(), kChannelNames.end(),
                                    [&](std::string_view name) { return same(word, name); });
    if (known == kChannelNames.end()) words.fail(where + ": " + channel_fault(word));
    const int channel = static_cast<int>(known - kChannelNames.begin());
    if (std::find(joint.channels.begin(), joint.channels.end(), channel) != joint.channels.end())
      words.fail(fmt::format("{}: '{}' is there twice", where, excerpt(word, kShownWord)));
    joint.channels.push_back(channel);
  }
}

// One joint of the file while its braces are open.
struct OpenJoint {
  int index = 0;
  bool end_site = false;
  bool has_offset = false;
  bool has_channels = false;
};

class HierarchyReader {
 public:
  explicit HierarchyReader(Words& words) : words_(words) {}

  std::vector<BvhJoint> read() {
    words_.expect("HIERARCHY", "start of the file");
    words_.expect("ROOT", "HIERARCHY");
    do {
      root_ = joints_.size();
      open(std::string(words_.name()), false);
      while (!open_.empty()) read_item(words_.next());
    } while (words_.accept("ROOT"));
    return std::move(joints_);
  }

 private:
  void read_item(std::string_view word) {
    OpenJoint& top = open_.back();
    BvhJoint& joint = joints_[top.index];
    if (same(word, "OFFSET") && !top.has_offset) {
      top.has_offset = true;
      read_offset(words_, joint);
    } else if (same(word, "CHANNELS") && !top.has_channels && !top.end_site) {
      top.has_channels = true;
      read_channels(words_, joint);
    } else if (same(word, "JOINT") && !top.end_site) {
      open(std::string(words_.name()), false);
    } else if ((same(word, "End") || same(word, "EndSite")) && !top.end_site) {
      if (same(word, "End")) words_.expect("Site", "End");
      words_.rest_of_name();  // some makers name it
      open(joint.name + "/end", true);
    } else if (word == "}") {
      if (!top.has_offset) words_.fail(fmt::format("joint '{}' has no OFFSET", joint.name));
      open_.pop_back();
    } else {
      words_.fail(fmt::format("inside joint '{}': expected {}, found {}", joint.name,
                              top.end_site ? "OFFSET or '}'" : "OFFSET, CHANNELS, JOINT, End Site or '}'",
                              Words::found(word)));
    }
  }

  void open(const std::string& name, bool end_site) {
    if (name.empty()) words_.fail("expected the name of a joint, found " + Words::found(words_.next()));
    const auto has_name = [&](const BvhJoint& joint) { return joint.name == name; };
    if (std::any_of(joints_.begin() + static_cast<std::ptrdiff_t>(root_), joints_.end(), has_name))
      words_.fail(fmt::format("joint '{}' is there twice", excerpt(name, kShownWord)));
    if (joints_.size() >= kMostJoints) words_.fail(fmt::format("more than {} joints", kMostJoints));
    words_.expect("{", "joint '" + excerpt(name, kShownWord) + "'");
    const int parent = open_.empty() ? -1 : open_.back().index;
    open_.push_back({.index = static_cast<int>(joints_.size()), .end_site = end_site});
    joints_.push_back({.name = name, .parent = parent, .offset = Eigen::Vector3d::Zero(), .channels = {}});
  }

  Words& words_;
  std::vector<BvhJoint> joints_;
  std::vector<OpenJoint> open_;
  std::size_t root_ = 0;  // of the person at hand
};

void read_frame(Words& words, std::size_t channels, Bvh& bvh, int frame) {
  const std::string where = fmt::format("frame {}", frame);
  std::size_t count = 0;
  for (std::string_view word = words.next_on_line(); !word.empty(); word = words.next_on_line(), ++count)
    if (count < channels) bvh.values.push_back(words.number(word, where));
  if (count != channels)
    words.fail(fmt::format("{}: expected {} numbers on the line, found {}", where, channels, count));
}

std::size_t channels_of(const Bvh& bvh) {
  std::size_t channels = 0;
  for (const BvhJoint& joint : bvh.joints) channels += joint.channels.size();
  return channels;
}

// Rokoko writes one frame more than it announces; whole ones are left out,
// anything else is refused.
void skip_frames_beyond(Words& words, std::size_t channels, Bvh& bvh) {
  int more = 0;
  for (; words.next_line(); ++more) {
    const std::string_view first = words.next_on_line();
    std::size_t count = 0;
    for (std::string_view word = first; !word.empty(); word = words.next_on_line()) ++count;
    if (count != channels)
      words.fail(
          fmt::format("expected nothing after the {} announced frames, found {}", bvh.frames, Words::found(first)));
  }
  if (more > 0)
    bvh.notes.push_back(fmt::format("the file has {} frames and announces {}: the announced ones are taken",
                                    bvh.frames + more, bvh.frames));
}

void read_motion(Words& words, Bvh& bvh) {
  words.expect("MOTION", "after the hierarchy");
  words.label("Frames", "MOTION");
  const double frames = words.number(words.next(), "Frames");
  if (!(frames >= 1.0 && frames <= 1e8 && frames == std::floor(frames)))
    words.fail(fmt::format("Frames: expected a whole number of at least 1, found {}", frames));
  words.label("Frame Time", "after Frames");
  bvh.frame_time = words.number(words.next(), "Frame Time");
  if (!(bvh.frame_time > 0.0)) words.fail(fmt::format("Frame Time: expected above 0 s, found {}", bvh.frame_time));
  if (const std::string_view word = words.next_on_line(); !word.empty())
    words.fail("after Frame Time: expected a new line, found " + Words::found(word));
  const std::size_t channels = channels_of(bvh);
  for (bvh.frames = 0; bvh.frames < static_cast<int>(frames); ++bvh.frames) {
    if (!words.next_line()) words.fail(fmt::format("expected {} frames as announced, found {}", frames, bvh.frames));
    read_frame(words, channels, bvh, bvh.frames);
  }
  skip_frames_beyond(words, channels, bvh);
}

// Some exporters give every joint position channels and fill those of the root
// alone: all joints would lie in one place.
void keep_offsets(Bvh& bvh) {
  const std::size_t width = channels_of(bvh);
  std::size_t column = 0;
  int joints = 0;
  for (BvhJoint& joint : bvh.joints) {
    bool has_position = false, filled = false;
    for (const int channel : joint.channels) {
      if (channel < 3) {
        has_position = true;
        for (int t = 0; t < bvh.frames && !filled; ++t) filled = bvh.values[t * width + column] != 0.0;
      }
      ++column;
    }
    joint.keeps_offset = joint.parent >= 0 && has_position && !filled && !joint.offset.isZero(0.0);
    joints += joint.keeps_offset ? 1 : 0;
  }
  if (joints > 0)
    bvh.notes.push_back(
        fmt::format("the position channels of {} joints are 0 "
                    "in all frames: their OFFSETs are taken",
                    joints));
}

}  // namespace

Bvh parse_bvh(std::string_view text, const std::string& name) {
  Words words(text, name);
  Bvh bvh;
  bvh.name = name;
  bvh.joints = HierarchyReader(words).read();
  read_motion(words, bvh);
  keep_offsets(bvh);
  return bvh;
}

Bvh read_bvh(const std::string& path) { return parse_bvh(read_plain_text(path, kMostMotionBytes), path); }

namespace {

constexpr double kSameFrame = 1e-9;  // of a frame

std::size_t channel_count(const Bvh& bvh) {
  std::size_t count = 0;
  for (const BvhJoint& joint : bvh.joints) count += joint.channels.size();
  return count;
}

Pose local_pose(const BvhJoint& joint, const double* values) {
  Pose X{.R = Eigen::Quaterniond::Identity(), .p = joint.offset};
  for (const int channel : joint.channels) {
    const double value = *values++;
    if (channel < 3) {
      if (!joint.keeps_offset) X.p[channel] = value;
    } else {
      const double angle = value * (std::numbers::pi / 180.0);
      X.R = X.R * Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(channel - 3)));
    }
  }
  X.R.normalize();
  return X;
}

}  // namespace

std::vector<Pose> local_poses(const Bvh& bvh, int frame) {
  std::vector<Pose> poses;
  poses.reserve(bvh.joints.size());
  const double* values = bvh.values.data() + static_cast<std::size_t>(frame) * channel_count(bvh);
  for (const BvhJoint& joint : bvh.joints) {
    poses.push_back(local_pose(joint, values));
    values += joint.channels.size();
  }
  return poses;
}

std::vector<Pose> local_poses_at(const Bvh& bvh, double index) {
  const double nearest = std::round(index);
  if (std::abs(index - nearest) <= kSameFrame * std::max(1.0, nearest))
    return local_poses(bvh, static_cast<int>(nearest));
  const int frame = static_cast<int>(index);
  std::vector<Pose> poses = local_poses(bvh, frame);
  const std::vector<Pose> next = local_poses(bvh, frame + 1);
  for (std::size_t j = 0; j < poses.size(); ++j) {
    poses[j] = interpolate(poses[j], next[j], index - frame);
    poses[j].R.normalize();
  }
  return poses;
}

std::vector<Pose> zero_local_poses(const Bvh& bvh) {
  std::vector<Pose> poses;
  poses.reserve(bvh.joints.size());
  for (const BvhJoint& joint : bvh.joints) poses.push_back({.R = Eigen::Quaterniond::Identity(), .p = joint.offset});
  return poses;
}

std::vector<Pose> global_poses(const Bvh& bvh, const std::vector<Pose>& local) {
  std::vector<Pose> poses;
  poses.reserve(local.size());
  for (std::size_t j = 0; j < local.size(); ++j) {
    const int parent = bvh.joints[j].parent;  // parents come first
    poses.push_back(parent < 0 ? local[j] : poses[parent] * local[j]);
    poses.back().R.normalize();
  }
  return poses;
}

}  // namespace duet
