#include "duet/replay/replay_header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>

#include "duet/core/require.h"
#include "duet/metrics/detector.h"
#include "duet/motion/human_motion.h"
#include "duet/replay/robot_outline.h"
#include "duet/robots/human_body.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr double kMetreStep = 5e-5, kTurnStep = 3.1e-5, kAngleStep = 5e-5;  // of a robot: 0.1 mm at its hands
constexpr double kPartnerStep = 1e-3, kForceStep = 0.1, kMarginStep = 1e-3;
constexpr int kVerdictStride = 5;  // frames

nlohmann::json vector_json(const Eigen::Ref<const Eigen::VectorXd>& vector) {
  return std::vector<double>(vector.begin(), vector.end());
}

nlohmann::json quaternion_json(const Eigen::Quaterniond& R) { return {R.w(), R.x(), R.y(), R.z()}; }

// Position and quaternion (w, x, y, z) without a jump of sign: q and -q are one turn.
Eigen::MatrixXd poses_of(int frames, const std::function<const Pose&(int)>& pose) {
  Eigen::MatrixXd values(frames, 7);
  Eigen::Vector4d before(1.0, 0.0, 0.0, 0.0);
  for (int t = 0; t < frames; ++t) {
    const Eigen::Quaterniond& R = pose(t).R;
    Eigen::Vector4d quat_wxyz(R.w(), R.x(), R.y(), R.z());
    if (quat_wxyz.dot(before) < 0.0) quat_wxyz = -quat_wxyz;
    before = quat_wxyz;
    values.row(t).head<3>() = pose(t).p.transpose();
    values.row(t).tail<4>() = quat_wxyz.transpose();
  }
  return values;
}

nlohmann::json motion_json(int frames, const std::function<const Pose&(int)>& pose,
                           const std::function<const Eigen::VectorXd&(int)>& angles, ReplayColumns& columns) {
  const Eigen::MatrixXd poses = poses_of(frames, pose);
  Eigen::MatrixXd q(frames, frames == 0 ? 0 : angles(0).size());
  for (int t = 0; t < frames; ++t) q.row(t) = angles(t).transpose();
  return {{"position", columns.add(poses.leftCols(3), kMetreStep)},
          {"turn", columns.add(poses.rightCols(4), kTurnStep)},
          {"q", columns.add(q, kAngleStep)}};
}

nlohmann::json contacts_json(const Recording& recording, ReplayColumns& columns) {
  std::vector<const RecordedContact*> human;
  for (const RecordedContact& contact : recording.contacts)
    if (contact.contact.side == ContactSide::kHuman) human.push_back(&contact);
  Eigen::MatrixXd where(human.size(), 3), points(human.size(), 3), forces(human.size(), 3);
  for (std::size_t i = 0; i < human.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    where.row(row) << human[i]->frame, human[i]->contact.link, human[i]->contact.other;
    points.row(row) = human[i]->contact.p_WC.transpose();
    forces.row(row) = human[i]->contact.f_W.transpose();
  }
  return {{"where", columns.add(where, 0.5)},
          {"points", columns.add(points, kPartnerStep)},
          {"forces", columns.add(forces, kForceStep)}};
}

// Margins as parts of their thresholds: they share an axis, whatever their units.
Eigen::MatrixXd scaled_margins(const DetectorTrace& trace) {
  Eigen::MatrixXd values = trace.margins;
  for (Eigen::Index k = 0; k < values.cols(); ++k) {
    const double threshold = std::abs(trace.thresholds[static_cast<std::size_t>(k)]);
    if (threshold > 0.0) values.col(k) /= threshold;
  }
  return values.cwiseMax(-9.0).cwiseMin(9.0);
}

// Frames at which a mask changes, the first one that is true first.
std::vector<int> changes(const std::vector<bool>& mask) {
  std::vector<int> frames;
  for (std::size_t t = 0; t < mask.size(); ++t)
    if (mask[t] != (t > 0 && mask[t - 1])) frames.push_back(static_cast<int>(t));
  return frames;
}

nlohmann::json trace_json(const DetectorTrace& trace, ReplayColumns& columns) {
  return {{"version", to_string(trace.version)},
          {"set", to_string(trace.set)},
          {"evidence", changes(trace.evidence)},
          {"success", changes(trace.success)},
          {"names", trace.names},
          {"thresholds", trace.thresholds},
          {"units", trace.units},
          {"frames", trace.frames},
          {"margins", columns.add(scaled_margins(trace), kMarginStep)}};
}

struct TracedDetector {
  DetectorVersion version;
  ThresholdSet set;
};

// The headline and another view of it. The rule `interaction` judges whole episodes: of it the act is traced, and the
// detector that asks for less.
std::array<TracedDetector, 2> traced_detectors(const ScoringRules& rules) {
  if (rules.detector == DetectorVersion::kInteraction)
    return {{{DetectorVersion::kRobot, ThresholdSet::kAct}, {DetectorVersion::kRobot, ThresholdSet::kPaper}}};
  const DetectorVersion other =
      rules.detector == DetectorVersion::kRobot ? DetectorVersion::kPaper : DetectorVersion::kRobot;
  return {{{rules.detector, rules.thresholds}, {other, rules.thresholds}}};
}

nlohmann::json detectors_json(const ReplayTrack& track, ReplayColumns& columns) {
  nlohmann::json list = nlohmann::json::array();
  if (!track.recording.task || !track.robot) return list;
  const ScoringRules rules = track.kept ? track.kept->rules : ScoringRules{};
  for (const auto& [version, set] : traced_detectors(rules)) {
    const DetectorTrace trace =
        detector_trace(track.recording, *track.robot, version, set, rules.readings.detectors, kVerdictStride);
    if (!trace.frames.empty()) list.push_back(trace_json(trace, columns));
  }
  return list;
}

// The members of its row that the page shows; what is not a number is null.
nlohmann::json row_json(const EpisodeRow& row) {
  nlohmann::json json = to_json(row);
  for (const char* key : {"trace", "feet", "contacts", "forces", "wall_s", "started_at"}) json.erase(key);
  return json;
}

nlohmann::json capsules_json(const PointTracks& partner) {
  nlohmann::json list = nlohmann::json::array();
  if (partner.frames() < 2) return list;
  const HumanBody body =
      make_human_body(bone_lengths(HumanMotion{.rate_hz = 50.0, .joints = partner, .rotations = {}}));
  for (const HumanCapsule& capsule : body.capsules)
    list.push_back({{"name", capsule.name},
                    {"region", capsule.region},
                    {"a", capsule.joint_a},
                    {"b", capsule.joint_b},
                    {"radius", capsule.radius},
                    {"begin", capsule.begin},
                    {"end", capsule.end}});
  return list;
}

nlohmann::json partner_json(const PointTracks& partner, ReplayColumns& columns) {
  Eigen::MatrixXd joints(partner.frames(), 3 * partner.points());
  for (int t = 0; t < partner.frames(); ++t) joints.row(t) = partner.frame(t).reshaped().transpose();
  return {{"joints", columns.add(joints, kPartnerStep)}, {"capsules", capsules_json(partner)}};
}

nlohmann::json limits_json(const ContactLimits& limits) {
  nlohmann::json regions = nlohmann::json::object();
  for (const RegionLimits& region : limits.regions) {
    const std::optional<double> limit = region.transient_n ? region.transient_n : region.quasi_static_n;
    if (limit)
      regions[region.region] = {{"newton", *limit}, {"kind", region.transient_n ? "transient" : "quasi-static"}};
  }
  return {{"name", limits.name}, {"mark", limits.mark()}, {"regions", std::move(regions)}};
}

// Robots and partners are there once, however many tracks have them.
class HeaderMaker {
 public:
  explicit HeaderMaker(ReplayColumns& columns) : columns_(columns) {}

  nlohmann::json scene_json(const ReplayScene& scene) {
    nlohmann::json tracks = nlohmann::json::array();
    for (const ReplayTrack& track : scene.tracks) tracks.push_back(track_json(track));
    return {{"id", scene.id},
            {"name", scene.name},
            {"task", scene.task},
            {"perturbation", scene.perturbation},
            {"successes", scene.successes},
            {"judged", scene.judged},
            {"disagreement", scene.disagreement()},
            {"tracks", std::move(tracks)}};
  }
  nlohmann::json robots = nlohmann::json::array(), partners = nlohmann::json::array();

 private:
  nlohmann::json track_json(const ReplayTrack& track) {
    const Recording& recording = track.recording;
    nlohmann::json json = {{"name", track.name},
                           {"repeat", track.repeat},
                           {"origin", track.origin},
                           {"robot", track.robot ? robot_place(*track.robot) : -1},
                           {"partner", partner_place(recording.partner)},
                           {"other_person", partner_place(track.other_person)},
                           {"rate_hz", recording.rate_hz},
                           {"frames", track.frames()},
                           {"act", {recording.phases.act_begin, recording.phases.act_end}},
                           {"outcome", to_string(recording.outcome)},
                           {"message", recording.message},
                           {"contacts", contacts_json(recording, columns_)},
                           {"detectors", detectors_json(track, columns_)}};
    json["motion"] = motion_json(
        recording.frames(), [&](int t) -> const Pose& { return recording.robot[t].X_WB; },
        [&](int t) -> const Eigen::VectorXd& { return recording.robot[t].q; }, columns_);
    json["reference"] = motion_json(
        static_cast<int>(recording.reference.size()), [&](int t) -> const Pose& { return recording.reference[t].X_WB; },
        [&](int t) -> const Eigen::VectorXd& { return recording.reference[t].q; }, columns_);
    if (track.kept) json["row"] = row_json(track.kept->row);
    return json;
  }
  int robot_place(const RobotModel& robot) {
    const auto [place, is_new] = robot_places_.try_emplace(robot.digest, static_cast<int>(robots.size()));
    if (is_new) robots.push_back(robot_json(robot));
    return place->second;
  }
  int partner_place(const PointTracks& partner) {
    if (partner.empty()) return -1;
    const auto found = std::ranges::find_if(partner_places_, [&](const PointTracks* one) { return *one == partner; });
    if (found != partner_places_.end()) return static_cast<int>(found - partner_places_.begin());
    partner_places_.push_back(&partner);
    partners.push_back(partner_json(partner, columns_));
    return static_cast<int>(partners.size()) - 1;
  }

  ReplayColumns& columns_;
  std::map<std::string, int> robot_places_;
  std::vector<const PointTracks*> partner_places_;
};

nlohmann::json outline_json(const RobotModel& robot) {
  const RobotOutline outline = robot_outline(robot);
  nlohmann::json hulls = nlohmann::json::array(), bars = nlohmann::json::array();
  for (const OutlineHull& hull : outline.hulls) {
    nlohmann::json spheres = nlohmann::json::array();
    for (const OutlineSphere& sphere : hull.spheres)
      spheres.push_back({sphere.center.x(), sphere.center.y(), sphere.center.z(), sphere.radius});
    hulls.push_back(
        {{"link", hull.link}, {"spheres", std::move(spheres)}, {"shapes", hull.shapes}, {"foot", hull.is_foot}});
  }
  for (const OutlineBar& bar : outline.bars)
    bars.push_back({{"links", {bar.from_link, bar.to_link}},
                    {"from", vector_json(bar.from)},
                    {"to", vector_json(bar.to)},
                    {"radius", bar.radius}});
  return {{"hulls", std::move(hulls)}, {"bars", std::move(bars)}};
}

}  // namespace

nlohmann::json robot_json(const RobotModel& robot) {
  nlohmann::json links = nlohmann::json::array(), shapes = nlohmann::json::array(), points = nlohmann::json::object();
  for (const RobotLink& link : robot.links)
    links.push_back({{"name", link.name},
                     {"parent", link.parent},
                     {"p", vector_json(link.X_PL.p)},
                     {"quat_wxyz", quaternion_json(link.X_PL.R)},
                     {"axis", vector_json(link.axis)}});
  for (const RobotShape& shape : robot.shapes)
    shapes.push_back({{"link", shape.link},
                      {"p", vector_json(shape.X_LS.p)},
                      {"quat_wxyz", quaternion_json(shape.X_LS.R)},
                      {"radius", shape.radius},
                      {"half_length", shape.half_length}});
  for (const auto& [name, frame] : robot.tracks)
    points[name] = {{"link", robot.frames[frame].link}, {"p", vector_json(robot.frames[frame].X_LF.p)}};
  return {
      {"name", robot.name}, {"links", links}, {"shapes", shapes}, {"points", points}, {"outline", outline_json(robot)}};
}

nlohmann::json replay_header(const ReplayContent& content, ReplayColumns& columns) {
  HeaderMaker maker(columns);
  nlohmann::json scenes = nlohmann::json::array();
  for (const ReplayScene& scene : content.scenes) scenes.push_back(maker.scene_json(scene));
  return {{"schema", "duet.replay/1"},
          {"title", content.title},
          {"notes", content.notes},
          {"episodes_of_run", content.episodes_of_run},
          {"limits", limits_json(content.limits)},
          {"robots", std::move(maker.robots)},
          {"partners", std::move(maker.partners)},
          {"scenes", std::move(scenes)}};
}

namespace {

constexpr double kMostSteps = 32767.0;  // to either side of a column's middle
constexpr std::int16_t kNotANumber = INT16_MIN;

struct ColumnScale {
  double base = 0.0, step = 1.0;
};

ColumnScale scale_of(const Eigen::Ref<const Eigen::VectorXd>& column, double step) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : column) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (low > high) return {0.0, step};
  const double base = low + (high - low) / 2.0;
  return {base, std::max(step, (high - low) / (2.0 * kMostSteps))};
}

std::int16_t quantised(double value, const ColumnScale& scale) {
  if (!std::isfinite(value)) return kNotANumber;
  return static_cast<std::int16_t>(std::lround(std::clamp((value - scale.base) / scale.step, -kMostSteps, kMostSteps)));
}

}  // namespace

nlohmann::json ReplayColumns::add(const Eigen::Ref<const Eigen::MatrixXd>& values, double step) {
  require(step > 0.0, "replay columns: expected a positive step");
  const auto rows = static_cast<std::size_t>(values.rows()), size = rows * static_cast<std::size_t>(values.cols());
  nlohmann::json bases = nlohmann::json::array(), steps = nlohmann::json::array();
  const std::size_t at = bytes_.size();
  bytes_.resize(at + 2 * size);  // the low bytes of all values, then the high ones
  for (Eigen::Index k = 0; k < values.cols(); ++k) {
    const ColumnScale scale = scale_of(values.col(k), step);
    bases.push_back(scale.base);
    steps.push_back(scale.step);
    std::uint16_t before = 0, before_that = 0;
    for (std::size_t t = 0; t < rows; ++t) {
      const auto value = static_cast<std::uint16_t>(quantised(values(static_cast<Eigen::Index>(t), k), scale));
      const auto second = static_cast<std::uint16_t>(value - 2 * before + before_that);  // modulo 65536
      const std::size_t place = at + static_cast<std::size_t>(k) * rows + t;
      bytes_[place] = static_cast<char>(second & 0xff);
      bytes_[place + size] = static_cast<char>(second >> 8);
      before_that = before;
      before = value;
    }
  }
  return {{"at", at}, {"rows", rows}, {"bases", std::move(bases)}, {"steps", std::move(steps)}};
}

namespace {

// The tracks up to a frame; those that are empty stay so.
Agent first_frames(const Agent& agent, Eigen::Index frames) {
  Agent part;
  for (Eigen::Matrix3Xd Agent::*track :
       {&Agent::lhand, &Agent::rhand, &Agent::head, &Agent::root, &Agent::torso, &Agent::lshoulder, &Agent::rshoulder})
    part.*track = (agent.*track).leftCols(std::min(frames, (agent.*track).cols()));
  return part;
}

bool is_finite(const Recording& recording) {
  for (const RobotState& state : recording.robot)
    if (!state.q.allFinite() || !state.X_WB.p.allFinite() || !state.X_WB.R.coeffs().allFinite()) return false;
  return true;
}

std::string unit_of(Task task, const std::string& name, ThresholdSet set) {
  try {
    return std::string(threshold_unit(task, name, set));
  } catch (const std::invalid_argument&) {
    return "";  // a margin over several thresholds ("overall")
  }
}

void name_margins(const DetectorResult& result, Task task, DetectorTrace& trace) {
  const Thresholds tau = thresholds(task, trace.set);
  for (const auto& [name, margin] : result.margins) {
    trace.names.push_back(name);
    const auto threshold = tau.find(name);
    trace.thresholds.push_back(threshold == tau.end() ? 1.0 : threshold->second);
    trace.units.push_back(unit_of(task, name, trace.set));
  }
}

void add_margins(const DetectorResult& result, Eigen::Index sample, DetectorTrace& trace) {
  trace.success.push_back(result.success);
  for (std::size_t k = 0; k < trace.names.size(); ++k) {
    const auto found = result.margins.find(trace.names[k]);
    const double margin = found == result.margins.end() ? NAN : found->second;
    trace.margins(sample, static_cast<Eigen::Index>(k)) = std::isfinite(margin) ? margin : NAN;
  }
}

}  // namespace

DetectorTrace detector_trace(const Recording& recording, const RobotModel& robot, DetectorVersion version,
                             ThresholdSet set, const DetectorReadings& readings, int stride) {
  require(recording.task.has_value(), "detector trace: expected a recording of a task, found one of none");
  DetectorTrace trace{.version = version,
                      .set = set,
                      .evidence = {},
                      .names = {},
                      .thresholds = {},
                      .units = {},
                      .frames = {},
                      .success = {},
                      .margins = {}};
  if (recording.partner.empty() || recording.frames() == 0 || !is_finite(recording)) return trace;
  const Agent human = human_agent(recording.partner), machine = robot_agent(robot, recording.robot);
  const DetectorResult whole = detect(*recording.task, human, machine, version, set, readings);
  trace.evidence = whole.frames;
  name_margins(whole, *recording.task, trace);
  for (int t = stride - 1; t < recording.frames() - 1; t += stride) trace.frames.push_back(t);
  trace.frames.push_back(recording.frames() - 1);
  trace.margins.resize(static_cast<Eigen::Index>(trace.frames.size()), static_cast<Eigen::Index>(trace.names.size()));
  for (std::size_t i = 0; i + 1 < trace.frames.size(); ++i)
    add_margins(detect(*recording.task, first_frames(human, trace.frames[i] + 1),
                       first_frames(machine, trace.frames[i] + 1), version, set, readings),
                static_cast<Eigen::Index>(i), trace);
  add_margins(whole, static_cast<Eigen::Index>(trace.frames.size()) - 1, trace);
  return trace;
}

}  // namespace duet
