#include "duet/bench/replay/replay_mcap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/mcap.h"
#include "duet/motion/human_motion.h"
#include "duet/results/json_fields.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

constexpr int kMcapStride = 2;  // frames: a scene 25 times a second

// What Foxglove needs of its schema; it knows the name.
constexpr const char* kSceneSchema =
    R"({"title":"foxglove.SceneUpdate","type":"object","properties":{"deletions":{"type":"array","items":{"type":"object"}},"entities":{"type":"array","items":{"type":"object"}}}})";
constexpr const char* kStateSchema =
    R"({"title":"duet.ReplayState","type":"object","properties":{"time":{"type":"number"},"q":{"type":"object"},"root":{"type":"array"},"partner_force":{"type":"number"}}})";

nlohmann::json xyz_json(const Eigen::Vector3d& p) { return {{"x", p.x()}, {"y", p.y()}, {"z", p.z()}}; }

nlohmann::json pose_json(const Eigen::Vector3d& p, const Eigen::Quaterniond& R) {
  return {{"position", xyz_json(p)}, {"orientation", {{"x", R.x()}, {"y", R.y()}, {"z", R.z()}, {"w", R.w()}}}};
}

nlohmann::json colour_json(double r, double g, double b, double a) { return {{"r", r}, {"g", g}, {"b", b}, {"a", a}}; }

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

nlohmann::json entity_json(const char* id, std::uint64_t time) {
  return {{"timestamp", stamp_json(time)},
          {"frame_id", "world"},
          {"id", id},
          {"lifetime", stamp_json(0)},
          {"frame_locked", false},
          {"metadata", nlohmann::json::array()},
          {"arrows", nlohmann::json::array()},
          {"cubes", nlohmann::json::array()},
          {"spheres", nlohmann::json::array()},
          {"cylinders", nlohmann::json::array()},
          {"lines", nlohmann::json::array()},
          {"triangles", nlohmann::json::array()},
          {"texts", nlohmann::json::array()},
          {"models", nlohmann::json::array()}};
}

class TrackWriter {
 public:
  TrackWriter(const ReplayTrack& track, double begin, std::uint16_t channel, McapWriter& file)
      : track_(track), begin_(begin), channel_(channel), file_(file), kinematics_(*track.robot) {
    const PointTracks& partner = track.recording.partner;
    if (partner.frames() > 1)
      human_ = make_human_body(bone_lengths(HumanMotion{.rate_hz = 50.0, .joints = partner, .rotations = {}}));
  }

  void write() {
    const Recording& recording = track_.recording;
    for (int t = 0; t < recording.frames(); t += kMcapStride) {
      const double seconds = begin_ + t / recording.rate_hz;
      time_ = static_cast<std::uint64_t>(std::llround(seconds * 1e9));
      kinematics_.update(recording.robot[t].X_WB, recording.robot[t].q);
      put(channel_, t, scene_of(t));
      put(static_cast<std::uint16_t>(channel_ + 1), t, state_of(t, seconds));
    }
  }

 private:
  nlohmann::json scene_of(int t) {
    nlohmann::json entities = nlohmann::json::array();
    entities.push_back(robot_of());
    if (!human_.capsules.empty()) entities.push_back(partner_of(t));
    entities.push_back(contacts_of(t));
    return {{"deletions", nlohmann::json::array()}, {"entities", std::move(entities)}};
  }
  nlohmann::json robot_of() {
    nlohmann::json entity = entity_json("robot", time_);
    const nlohmann::json colour = colour_json(0.0, 0.45, 0.7, 1.0);
    for (std::size_t i = 0; i < track_.robot->shapes.size(); ++i) {
      const RobotShape& shape = track_.robot->shapes[i];
      const Eigen::Vector3d p = kinematics_.shape_position(static_cast<int>(i));
      const Eigen::Vector3d half =
          kinematics_.R_WL(shape.link) * (shape.X_LS.R * Eigen::Vector3d(0.0, 0.0, shape.half_length));
      add_capsule(p - half, p + half, shape.radius, colour, entity);
    }
    return entity;
  }
  nlohmann::json partner_of(int t) {
    nlohmann::json entity = entity_json("partner", time_);
    const nlohmann::json colour = colour_json(0.85, 0.72, 0.55, 1.0);
    for (const HumanCapsule& capsule : human_.capsules) {
      const auto [a, b] = capsule.ends(track_.recording.partner.frame(t));
      add_capsule(a, b, capsule.radius, colour, entity);
    }
    return entity;
  }
  // Arrows of 0.5 m a 100 N.
  nlohmann::json contacts_of(int t) {
    nlohmann::json entity = entity_json("contacts", time_);
    for (const Contact& contact : at(t)) {
      const double newton = contact.f_W.norm();
      if (newton <= 0.0) continue;
      const Eigen::Quaterniond R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), contact.f_W);
      entity["arrows"].push_back({{"pose", pose_json(contact.p_WC, R)},
                                  {"shaft_length", 0.004 * newton},
                                  {"shaft_diameter", 0.015},
                                  {"head_length", 0.001 * newton},
                                  {"head_diameter", 0.03},
                                  {"color", colour_json(0.84, 0.1, 0.1, 1.0)}});
    }
    return entity;
  }
  nlohmann::json state_of(int t, double seconds) {
    const RobotState& state = track_.recording.robot[t];
    nlohmann::json q = nlohmann::json::object();
    for (std::size_t i = 0; i < track_.robot->joints.size(); ++i)
      q[track_.robot->joints[i].name] = number_or_null(state.q[static_cast<Eigen::Index>(i)]);
    double force = 0.0;
    for (const Contact& contact : at(t)) force += contact.f_W.norm();
    return {{"time", seconds},
            {"q", std::move(q)},
            {"root", {state.X_WB.p.x(), state.X_WB.p.y(), state.X_WB.p.z()}},
            {"partner_force", force}};
  }
  // Of the partner.
  std::vector<Contact> at(int t) {
    std::vector<Contact> contacts;
    for (const RecordedContact& contact : track_.recording.contacts)
      if (contact.frame == t && contact.contact.side == ContactSide::kHuman) contacts.push_back(contact.contact);
    return contacts;
  }
  void put(std::uint16_t channel, int t, const nlohmann::json& json) {
    const std::string text = dumped(json);
    if (!file_.write(channel, static_cast<std::uint32_t>(t), time_, std::as_bytes(std::span(text))))
      throw StorageError("the MCAP file cannot be written");
  }

  const ReplayTrack& track_;
  double begin_;
  std::uint16_t channel_;
  McapWriter& file_;
  Kinematics kinematics_;
  HumanBody human_;
  std::uint64_t time_ = 0;
};

double begin_of(const ReplayTrack& track) { return -track.recording.phases.act_begin / track.recording.rate_hz; }

}  // namespace

void write_replay_mcap(const ReplayContent& content, const std::string& path) {
  std::filesystem::remove(path);
  McapWriter file(path);
  std::vector<std::pair<const ReplayTrack*, double>> tracks;
  for (const ReplayScene& scene : content.scenes) {
    double earliest = 0.0;
    for (const ReplayTrack& track : scene.tracks) earliest = std::min(earliest, begin_of(track));
    for (const ReplayTrack& track : scene.tracks) {
      const auto id = static_cast<std::uint16_t>(2 * tracks.size() + 1);
      const std::string topic = fmt::format("/{}/{}", scene.id, track.name);
      file.add({id, topic + "/scene", "json", "foxglove.SceneUpdate", "jsonschema", kSceneSchema});
      file.add({static_cast<std::uint16_t>(id + 1), topic + "/state", "json", "duet.ReplayState", "jsonschema",
                kStateSchema});
      tracks.emplace_back(&track, begin_of(track) - earliest);
    }
  }
  for (std::size_t i = 0; i < tracks.size(); ++i)
    TrackWriter(*tracks[i].first, tracks[i].second, static_cast<std::uint16_t>(2 * i + 1), file).write();
  if (!file.finish()) throw StorageError(fmt::format("'{}' cannot be written", path));
}

}  // namespace duet
