#include "duet/training/dstar/demonstrations.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/nn/safetensors.h"

namespace duet {
namespace {

// A file made here may be larger than one of somebody else: 2,000 clips are 2.5 GB.
constexpr std::int64_t kMostDemonstrationBytes = std::int64_t{1} << 35;
constexpr const char* kFormat = "duet.demonstrations/3";
constexpr int kPartnerSize = 3 * kSmplJoints;

// Keeps the memory of hours of frames from being copied at each demonstration.
void grow(Eigen::MatrixXf& matrix, Eigen::Index rows, Eigen::Index used, Eigen::Index more) {
  if (matrix.rows() == rows && matrix.cols() >= used + more) return;
  Eigen::MatrixXf larger(rows, used + more);
  if (used > 0) larger.leftCols(used) = matrix.leftCols(used);
  matrix.swap(larger);
}

void write_pose(const Pose& X_WB, Eigen::Ref<Eigen::VectorXf> out) {
  out << X_WB.p.cast<float>(), Eigen::Vector4d(X_WB.R.w(), X_WB.R.x(), X_WB.R.y(), X_WB.R.z()).cast<float>();
}

Pose read_pose(const Eigen::Ref<const Eigen::VectorXf>& in) {
  return {Eigen::Quaterniond(in[3], in[4], in[5], in[6]).normalized(), in.head<3>().cast<double>()};
}

nlohmann::json json_of(const Demonstration& entry) {
  return {{"clip", entry.clip_id},         {"digest", entry.digest},
          {"task", to_string(entry.task)}, {"act", {entry.phases.act_begin, entry.phases.act_end}},
          {"leads", entry.leads},          {"frames", entry.frames}};
}

std::vector<Demonstration> list_of(const std::string& text, const std::string& path) {
  std::vector<Demonstration> list;
  int begin = 0;
  const nlohmann::json items = parse_json(text, fmt::format("{}: metadata 'demonstrations'", path));
  try {
    for (const nlohmann::json& item : items) {
      Demonstration entry{item.at("clip"),
                          item.at("digest"),
                          parse_task(item.at("task").get<std::string>()),
                          {item.at("act").at(0), item.at("act").at(1)},
                          item.at("leads"),
                          begin,
                          item.at("frames")};
      require(entry.frames > 0, "a demonstration without frames");
      begin = entry.end();
      list.push_back(std::move(entry));
    }
  } catch (const std::exception& error) {
    throw InputError(fmt::format("{}: metadata 'demonstrations': {}", path, error.what()));
  }
  return list;
}

}  // namespace

void DemonstrationSet::add(Demonstration entry, const std::vector<RobotState>& seen, const RobotMotion& meant,
                           const PointTracks& partner_joints) {
  require(static_cast<int>(seen.size()) == meant.frames() && partner_joints.frames() == meant.frames(),
          "demonstration '{}': {} states, {} references and {} frames of the partner, expected as many", entry.clip_id,
          seen.size(), meant.frames(), partner_joints.frames());
  const Eigen::Index n = meant.q.rows(), used = list.empty() ? 0 : list.back().end(), more = meant.frames();
  const Eigen::Index room = std::max(more, used / 2);  // grows by halves, trimmed when it is saved
  grow(observed, 13 + 2 * n, used, observed.cols() >= used + more ? 0 : room);
  grow(wanted, 7 + n, used, wanted.cols() >= used + more ? 0 : room);
  grow(partner, kPartnerSize, used, partner.cols() >= used + more ? 0 : room);
  for (int t = 0; t < more; ++t) {
    write_pose(seen[t].X_WB, observed.col(used + t).head(7));
    observed.col(used + t).tail(6 + 2 * n) << seen[t].v_WB.cast<float>(), seen[t].w_WB_B.cast<float>(),
        seen[t].q.cast<float>(), seen[t].v.cast<float>();
    write_pose(meant.root[t], wanted.col(used + t).head(7));
    wanted.col(used + t).tail(n) = meant.q.col(t).cast<float>();
    partner.col(used + t) = partner_joints.frame(t).reshaped().cast<float>();
  }
  entry.begin = static_cast<int>(used);
  entry.frames = static_cast<int>(more);
  list.push_back(std::move(entry));
}

void DemonstrationSet::append(const DemonstrationSet& other) {
  require(other.robot_digest == robot_digest, "demonstrations of two robots cannot be one set");
  const int used = list.empty() ? 0 : list.back().end(), more = other.list.empty() ? 0 : other.list.back().end();
  const auto join = [&](Eigen::MatrixXf& mine, const Eigen::MatrixXf& theirs) {
    Eigen::MatrixXf both(theirs.rows(), used + more);
    both << mine.leftCols(used), theirs.leftCols(more);
    mine.swap(both);
  };
  join(observed, other.observed);
  join(wanted, other.wanted);
  join(partner, other.partner);
  for (Demonstration entry : other.list) {
    entry.begin += used;
    list.push_back(std::move(entry));
  }
}

RobotState DemonstrationSet::state(int column) const {
  const auto in = observed.col(column);
  const Eigen::Index n = (observed.rows() - 13) / 2;
  RobotState state;
  state.X_WB = read_pose(in.head(7));
  state.v_WB = in.segment<3>(7).cast<double>();
  state.w_WB_B = in.segment<3>(10).cast<double>();
  state.q = in.segment(13, n).cast<double>();
  state.v = in.tail(n).cast<double>();
  return state;
}

Reference DemonstrationSet::reference(int column) const {
  const auto in = wanted.col(column);
  return {read_pose(in.head(7)), in.tail(wanted.rows() - 7).cast<double>()};
}

std::vector<RobotState> states_of(const RobotMotion& motion) {
  std::vector<RobotState> states(motion.frames());
  for (int t = 0; t < motion.frames(); ++t) {
    const int before = std::max(0, t - 1), after = std::min(motion.frames() - 1, t + 1);
    const double seconds = std::max(1, after - before) / motion.rate_hz;
    RobotState& state = states[t];
    state.X_WB = motion.root[t];
    state.q = motion.q.col(t);
    state.v_WB = (motion.root[after].p - motion.root[before].p) / seconds;
    const Eigen::AngleAxisd turn(motion.root[before].R.conjugate() * motion.root[after].R);
    const double angle = std::remainder(turn.angle(), 2.0 * EIGEN_PI);
    state.w_WB_B = turn.axis() * (angle / seconds);
    state.v = (motion.q.col(after) - motion.q.col(before)) / seconds;
  }
  return states;
}

void save_demonstrations(const DemonstrationSet& set, const std::string& path) {
  nlohmann::json list = nlohmann::json::array();
  for (const Demonstration& entry : set.list) list.push_back(json_of(entry));
  const int used = set.list.empty() ? 0 : set.list.back().end();
  SafeTensors file;
  file.metadata = {{"format", kFormat},
                   {"robot_digest", set.robot_digest},
                   {"origin", set.origin},
                   {"demonstrations", dumped(list)}};
  file.tensors["observed"] = columns_tensor(set.observed.leftCols(used));
  file.tensors["wanted"] = columns_tensor(set.wanted.leftCols(used));
  file.tensors["partner"] = columns_tensor(set.partner.leftCols(used));
  write_safetensors(path, file);
}

DemonstrationSet load_demonstrations(const std::string& path, const std::string& robot_digest,
                                     const std::string& origin) {
  const SafeTensors file = parse_safetensors(read_file(path, kMostDemonstrationBytes), path);
  expect_text(file, "format", kFormat, path);
  DemonstrationSet set;
  set.robot_digest = text_of(file, "robot_digest", path);
  if (set.robot_digest != robot_digest)
    throw InputError(fmt::format("{}: demonstrations of another robot (digest {}..., expected {}...)", path,
                                 set.robot_digest.substr(0, 12), robot_digest.substr(0, 12)));
  set.origin = text_of(file, "origin", path);
  if (set.origin != origin)
    throw InputError(fmt::format("{}: demonstrations made otherwise: expected {}, found {}: choose another folder",
                                 path, origin, set.origin));
  set.list = list_of(text_of(file, "demonstrations", path), path);
  const std::int64_t used = set.list.empty() ? 0 : set.list.back().end();
  const auto wanted = file.tensors.find("wanted");
  const std::int64_t rows =
      wanted != file.tensors.end() && wanted->second.shape.size() == 2 ? wanted->second.shape[1] : 7;
  if (rows < 7)
    throw InputError(
        fmt::format("{}: tensor 'wanted': expected 7 values of a root and the joints', found {}", path, rows));
  set.wanted = columns_of(file, "wanted", rows, used, path);
  set.observed = columns_of(file, "observed", 13 + 2 * (rows - 7), used, path);
  set.partner = columns_of(file, "partner", kPartnerSize, used, path);
  return set;
}

void check_held_out(const DemonstrationSet& set, const std::vector<std::string>& digests, const std::string& split) {
  const std::set<std::string> held(digests.begin(), digests.end());
  for (const Demonstration& entry : set.list) {
    if (!held.contains(entry.digest)) continue;
    throw InputError(
        fmt::format("clip '{}' ({}) is in the test split '{}': a policy that is tested on it may not learn "
                    "from it",
                    entry.clip_id, to_string(entry.task), split));
  }
}

std::vector<std::string> load_split(const std::string& path) {
  std::istringstream lines(read_text(path));
  std::vector<std::string> digests;
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.empty() || line.front() == '#') continue;
    const std::string digest = line.substr(0, line.find(' '));
    if (digest.size() != 64 || digest.find_first_not_of("0123456789abcdef") != std::string::npos)
      throw InputError(fmt::format("{}:{}: expected a SHA-256 (64 hexadecimal digits) and a clip, found '{}'", path,
                                   number, excerpt(line)));
    digests.push_back(digest);
  }
  return digests;
}

}  // namespace duet
