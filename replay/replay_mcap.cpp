#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "duet/archives/mcap.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/human_motion.h"
#include "duet/replay/replay_content.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr int kMcapStride = 2;  // frames: 25 times a second

// Schemas for Foxglove, which knows the names.
constexpr const char* kSceneSchema =
    R"({"title":"foxglove.SceneUpdate","type":"object","properties":{"deletions":{"type":"array","items":{"type":"object"}},"entities":{"type":"array","items":{"type":"object"}}}})";
constexpr const char* kTransformSchema =
    R"({"title":"foxglove.FrameTransforms","type":"object","properties":{"transforms":{"type":"array","items":{"type":"object"}}}})";
constexpr const char* kStateSchema =
    R"({"title":"duet.ReplayState","type":"object","properties":{"time":{"type":"number"},"q":{"type":"object"},"root":{"type":"array"},"partner_force":{"type":"number"}}})";

// Rounds to five digits: 0.01 mm, or what turns a limb of half a metre by that.
double rounded(double x) { return std::round(x * 1e5) / 1e5; }

nlohmann::json xyz_json(const Eigen::Vector3d& p) {
  return {{"x", rounded(p.x())}, {"y", rounded(p.y())}, {"z", rounded(p.z())}};
}

nlohmann::json turn_json(const Eigen::Quaterniond& R) {
  return {{"x", rounded(R.x())}, {"y", rounded(R.y())}, {"z", rounded(R.z())}, {"w", rounded(R.w())}};
}

nlohmann::json pose_json(const Eigen::Vector3d& p, const Eigen::Quaterniond& R) {
  return {{"position", xyz_json(p)}, {"orientation", turn_json(R)}};
}

nlohmann::json colour_json(double r, double g, double b) { return {{"r", r}, {"g", g}, {"b", b}, {"a", 1.0}}; }

nlohmann::json sphere_json(const Eigen::Vector3d& p, double radius, const nlohmann::json& colour) {
  return {{"pose", pose_json(p, Eigen::Quaterniond::Identity())},
          {"size", xyz_json(Eigen::Vector3d::Constant(2.0 * radius))},
          {"color", colour}};
}

// A cylinder with a sphere at either end.
void add_capsule(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius, const nlohmann::json& colour,
                 nlohmann::json& entity) {
  entity["spheres"].push_back(sphere_json(a, radius, colour));
  if ((b - a).norm() < 1e-6) return;
  entity["spheres"].push_back(sphere_json(b, radius, colour));
  const Eigen::Quaterniond R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), b - a);
  entity["cylinders"].push_back({{"pose", pose_json((a + b) / 2.0, R)},
                                 {"size", {{"x", 2.0 * radius}, {"y", 2.0 * radius}, {"z", (b - a).norm()}}},
                                 {"bottom_scale", 1.0},
                                 {"top_scale", 1.0},
                                 {"color", colour}});
}

nlohmann::json stamp_json(std::uint64_t time) {
  return {{"sec", time / 1'000'000'000}, {"nsec", time % 1'000'000'000}};
}

// Fixed to its frame.
nlohmann::json entity_json(const std::string& id, const std::string& frame, std::uint64_t time) {
  nlohmann::json entity = {
      {"timestamp", stamp_json(time)}, {"frame_id", frame},    {"id", id},
      {"lifetime", stamp_json(0)},     {"frame_locked", true}, {"metadata", nlohmann::json::array()}};
  for (const char* kind : {"arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models"})
    entity[kind] = nlohmann::json::array();
  return entity;
}

nlohmann::json transform_json(const std::string& frame, const Eigen::Vector3d& p, const Eigen::Quaterniond& R,
                              std::uint64_t time) {
  return {{"timestamp", stamp_json(time)},
          {"parent_frame_id", "world"},
          {"child_frame_id", frame},
          {"translation", xyz_json(p)},
          {"rotation", turn_json(R)}};
}

// Topics of one file, which may be added at any time.
class ReplayTopics {
 public:
  // Writes `part`; messages name `path`, the file that it becomes.
  ReplayTopics(std::string path, const std::string& part) : path_(std::move(path)), file_(part, McapChunks::kSmall) {}

  std::uint16_t add(const std::string& topic, const char* schema_name, const char* schema) {
    require(topics_ < std::numeric_limits<std::uint16_t>::max(), "an MCAP file has at most 65535 topics");
    file_.add({++topics_, topic, "json", schema_name, "jsonschema", schema});
    return topics_;
  }
  std::uint16_t scene(const std::string& topic) { return add(topic, "foxglove.SceneUpdate", kSceneSchema); }
  std::uint16_t transforms(const std::string& topic) {
    return add(topic, "foxglove.FrameTransforms", kTransformSchema);
  }
  void put(std::uint16_t topic, int t, std::uint64_t time, const nlohmann::json& json) {
    const std::string text = dumped(json);
    if (!file_.write(topic, static_cast<std::uint32_t>(t), time, std::as_bytes(std::span(text)))) fail_to_write();
  }
  void put_entities(std::uint16_t topic, int t, std::uint64_t time, nlohmann::json entities) {
    put(topic, t, time, {{"deletions", nlohmann::json::array()}, {"entities", std::move(entities)}});
  }
  void finish() {
    if (!file_.finish()) fail_to_write();
  }

 private:
  [[noreturn]] void fail_to_write() const {
    throw StorageError(fmt::format("cannot write '{}': {}", path_, std::generic_category().message(file_.error())));
  }

  std::string path_;
  McapWriter file_;
  std::uint16_t topics_ = 0;
};

std::uint64_t nanoseconds(double begin, int t, double rate_hz) {
  return static_cast<std::uint64_t>(std::llround((begin + t / rate_hz) * 1e9));
}

// Capsules as long as in the first frame.
void write_person(const PointTracks& person, double rate_hz, double begin, const std::string& name,
                  ReplayTopics& topics) {
  const HumanBody human =
      make_human_body(bone_lengths(HumanMotion{.rate_hz = rate_hz, .joints = person, .rotations = {}}));
  const std::uint16_t bodies = topics.scene("/" + name), where = topics.transforms("/" + name + "/where");
  const nlohmann::json colour = colour_json(0.85, 0.72, 0.55);
  nlohmann::json entities = nlohmann::json::array();
  for (const HumanCapsule& capsule : human.capsules) {
    const auto [a, b] = capsule.ends(person.frame(0));
    const Eigen::Vector3d half(0.0, 0.0, (b - a).norm() / 2.0);
    entities.push_back(entity_json(capsule.name, name + "/" + capsule.name, nanoseconds(begin, 0, 1.0)));
    add_capsule(-half, half, capsule.radius, colour, entities.back());
  }
  topics.put_entities(bodies, 0, nanoseconds(begin, 0, 1.0), std::move(entities));
  for (int t = 0; t < person.frames(); t += kMcapStride) {
    const std::uint64_t time = nanoseconds(begin, t, rate_hz);
    nlohmann::json transforms = nlohmann::json::array();
    for (const HumanCapsule& capsule : human.capsules) {
      const auto [a, b] = capsule.ends(person.frame(t));
      const Eigen::Quaterniond R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), b - a);
      transforms.push_back(transform_json(name + "/" + capsule.name, (a + b) / 2.0, R, time));
    }
    topics.put(where, t, time, {{"transforms", std::move(transforms)}});
  }
}

class TrackWriter {
 public:
  TrackWriter(const ReplayTrack& track, double begin, std::string name, ReplayTopics& topics)
      : track_(track), begin_(begin), name_(std::move(name)), topics_(topics), kinematics_(*track.robot) {}

  void write() {
    const std::uint16_t where = topics_.transforms("/" + name_ + "/where");
    const std::uint16_t contacts = topics_.scene("/" + name_ + "/contacts");
    const std::uint16_t state = topics_.add("/" + name_ + "/state", "duet.ReplayState", kStateSchema);
    time_ = nanoseconds(begin_, 0, 1.0);
    topics_.put_entities(topics_.scene("/" + name_ + "/robot"), 0, time_, links_json());
    const Recording& recording = track_.recording;
    bool touched = true;  // so that the first frame has its arrows, or none
    for (int t = 0; t < recording.frames(); t += kMcapStride) {
      time_ = nanoseconds(begin_, t, recording.rate_hz);
      kinematics_.update(recording.robot[t].X_WB, recording.robot[t].q);
      topics_.put(where, t, time_, {{"transforms", transforms_json()}});
      const std::vector<Contact> now = at(t);
      if (touched || !now.empty()) topics_.put_entities(contacts, t, time_, {contacts_json(now)});
      touched = !now.empty();
      topics_.put(state, t, time_, state_json(t, now));
    }
  }

 private:
  [[nodiscard]] std::string frame(std::size_t link) const { return name_ + "/" + track_.robot->links[link].name; }

  nlohmann::json links_json() {
    const nlohmann::json colour = colour_json(0.0, 0.45, 0.7);
    nlohmann::json entities = nlohmann::json::array();
    for (std::size_t link = 0; link < track_.robot->links.size(); ++link) {
      nlohmann::json entity = entity_json(track_.robot->links[link].name, frame(link), time_);
      for (const RobotShape& shape : track_.robot->shapes) {
        if (shape.link != static_cast<int>(link)) continue;
        const Eigen::Vector3d half = shape.X_LS.R * Eigen::Vector3d(0.0, 0.0, shape.half_length);
        add_capsule(shape.X_LS.p - half, shape.X_LS.p + half, shape.radius, colour, entity);
      }
      if (!entity["spheres"].empty()) entities.push_back(std::move(entity));
    }
    return entities;
  }
  nlohmann::json transforms_json() {
    nlohmann::json transforms = nlohmann::json::array();
    for (std::size_t link = 0; link < track_.robot->links.size(); ++link) {
      const int i = static_cast<int>(link);
      transforms.push_back(
          transform_json(frame(link), kinematics_.p_WL(i), Eigen::Quaterniond(kinematics_.R_WL(i)), time_));
    }
    return transforms;
  }
  // Arrows of 0.5 m a 100 N.
  nlohmann::json contacts_json(const std::vector<Contact>& contacts) const {
    nlohmann::json entity = entity_json("contacts", "world", time_);
    for (const Contact& contact : contacts) {
      const double newton = contact.f_W.norm();
      if (newton <= 0.0) continue;
      const Eigen::Quaterniond R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), contact.f_W);
      entity["arrows"].push_back({{"pose", pose_json(contact.p_WC, R)},
                                  {"shaft_length", 0.004 * newton},
                                  {"shaft_diameter", 0.015},
                                  {"head_length", 0.001 * newton},
                                  {"head_diameter", 0.03},
                                  {"color", colour_json(0.84, 0.1, 0.1)}});
    }
    return entity;
  }
  nlohmann::json state_json(int t, const std::vector<Contact>& contacts) const {
    const RobotState& state = track_.recording.robot[t];
    nlohmann::json q = nlohmann::json::object();
    for (std::size_t i = 0; i < track_.robot->joints.size(); ++i)
      q[track_.robot->joints[i].name] = number_or_null(rounded(state.q[static_cast<Eigen::Index>(i)]));
    double force = 0.0;
    for (const Contact& contact : contacts) force += contact.f_W.norm();
    const Eigen::Vector3d& p = state.X_WB.p;
    return {{"time", begin_ + t / track_.recording.rate_hz},
            {"q", std::move(q)},
            {"root", {rounded(p.x()), rounded(p.y()), rounded(p.z())}},
            {"partner_force", force}};
  }
  // Contacts with the partner.
  [[nodiscard]] std::vector<Contact> at(int t) const {
    std::vector<Contact> contacts;
    for (const RecordedContact& contact : track_.recording.contacts)
      if (contact.frame == t && contact.contact.side == ContactSide::kHuman) contacts.push_back(contact.contact);
    return contacts;
  }

  const ReplayTrack& track_;
  double begin_;
  std::string name_;
  ReplayTopics& topics_;
  Kinematics kinematics_;
  std::uint64_t time_ = 0;
};

double begin_of(const ReplayTrack& track) { return -track.recording.phases.act_begin / track.recording.rate_hz; }

// Whether what b's partner does is the beginning of what a's does, at the same times.
bool same_partner(const ReplayTrack& a, const ReplayTrack& b) {
  const std::vector<double>&whole = a.recording.partner.data(), &part = b.recording.partner.data();
  return begin_of(a) == begin_of(b) && part.size() <= whole.size() &&
         std::equal(part.begin(), part.end(), whole.begin());
}

void write_scene(const ReplayScene& scene, ReplayTopics& topics) {
  double earliest = 0.0;
  const ReplayTrack* longest = nullptr;
  for (const ReplayTrack& track : scene.tracks) {
    earliest = std::min(earliest, begin_of(track));
    const int frames = track.recording.partner.frames();
    if (frames > 1 && (longest == nullptr || frames > longest->recording.partner.frames())) longest = &track;
  }
  if (longest != nullptr)
    write_person(longest->recording.partner, longest->recording.rate_hz, begin_of(*longest) - earliest,
                 scene.id + "/partner", topics);
  for (const ReplayTrack& track : scene.tracks) {
    const std::string name = fmt::format("{}/{}", scene.id, track.name);
    const double begin = begin_of(track) - earliest;
    if (track.recording.partner.frames() > 1 && !same_partner(*longest, track))
      write_person(track.recording.partner, track.recording.rate_hz, begin, name + "/partner", topics);
    if (track.other_person.frames() > 1)
      write_person(track.other_person, track.recording.rate_hz, begin, name + "/person", topics);
    if (track.robot) TrackWriter(track, begin, name, topics).write();
  }
}

}  // namespace

void write_replay_mcap(const ReplayContent& content, const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (fs::exists(path, ignored) && !fs::is_regular_file(path, ignored))
    throw StorageError(fmt::format("cannot write '{}': expected a file, found a folder, a device or a pipe", path));
  const std::string part = fmt::format("{}.part-{}", path, ::getpid());
  try {
    fs::remove(part, ignored);
    ReplayTopics topics(path, part);
    for (const ReplayScene& scene : content.scenes) write_scene(scene, topics);
    topics.finish();
    fs::rename(part, path);
  } catch (...) {
    fs::remove(part, ignored);
    throw;
  }
}

}  // namespace duet
