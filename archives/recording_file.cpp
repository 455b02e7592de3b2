#include "duet/archives/recording_file.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/archives/npy/npz.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr const char* kSchema = "duet.recording";
constexpr std::int64_t kVersion = 1;

// Rows of a (T, n) table, one after the other.
struct Table {
  std::vector<double> values;
  std::vector<std::size_t> shape;
};

template <typename Rows, typename Row>
Table table(const Rows& rows, std::size_t width, const Row& row) {
  Table table{{}, {rows.size(), width}};
  table.values.reserve(rows.size() * width);
  for (const auto& entry : rows) {
    const Eigen::VectorXd values = row(entry);
    table.values.insert(table.values.end(), values.data(), values.data() + values.size());
  }
  return table;
}

void put(Npz& npz, const std::string& key, Table table) {
  npz.set(key, std::move(table.values), std::move(table.shape));
}

Eigen::Vector4d wxyz(const Pose& X_WB) { return {X_WB.R.w(), X_WB.R.x(), X_WB.R.y(), X_WB.R.z()}; }

void check_sizes(const Recording& recording) {
  const std::size_t frames = recording.robot.size();
  const auto check = [](const char* what, std::size_t expected, std::size_t found) {
    require(expected == found, "recording: expected {} of size {}, found {}", what, expected, found);
  };
  check("reference", frames, recording.reference.size());
  check("q_target", frames, recording.q_target.size());
  if (!recording.partner.empty()) check("partner", frames, static_cast<std::size_t>(recording.partner.frames()));
  if (frames == 0) return;
  if (!recording.partner.empty())
    check("partner's joints", kSmplJoints, static_cast<std::size_t>(recording.partner.points()));
  const Eigen::Index joints = recording.robot.front().q.size();
  for (std::size_t t = 0; t < frames; ++t) {
    const bool same = recording.robot[t].q.size() == joints && recording.robot[t].v.size() == joints &&
                      recording.reference[t].q.size() == joints && recording.q_target[t].size() == joints;
    require(same, "recording: frame {} has joint vectors of other sizes than {}", t, joints);
  }
}

void put_robot(Npz& npz, const Recording& recording, std::size_t joints) {
  const auto& states = recording.robot;
  put(npz, "root_position", table(states, 3, [](const RobotState& s) { return s.X_WB.p; }));
  put(npz, "root_quat_wxyz", table(states, 4, [](const RobotState& s) { return wxyz(s.X_WB); }));
  put(npz, "root_velocity", table(states, 3, [](const RobotState& s) { return s.v_WB; }));
  put(npz, "root_angular_velocity", table(states, 3, [](const RobotState& s) { return s.w_WB_B; }));
  put(npz, "q", table(states, joints, [](const RobotState& s) { return s.q; }));
  put(npz, "v", table(states, joints, [](const RobotState& s) { return s.v; }));
  put(npz, "reference_position", table(recording.reference, 3, [](const Reference& r) { return r.X_WB.p; }));
  put(npz, "reference_quat_wxyz", table(recording.reference, 4, [](const Reference& r) { return wxyz(r.X_WB); }));
  put(npz, "reference_q", table(recording.reference, joints, [](const Reference& r) { return r.q; }));
  put(npz, "q_target", table(recording.q_target, joints, [](const Eigen::VectorXd& q) { return q; }));
}

void put_contacts(Npz& npz, const std::vector<RecordedContact>& contacts) {
  const std::size_t count = contacts.size();
  const auto put_integers = [&](const char* key, const auto& value) {
    std::vector<std::int64_t> values;
    values.reserve(count);
    for (const RecordedContact& entry : contacts) values.push_back(static_cast<std::int64_t>(value(entry)));
    npz.set(key, std::move(values), {count});
  };
  put_integers("contact_frame", [](const RecordedContact& c) { return c.frame; });
  put_integers("contact_link", [](const RecordedContact& c) { return c.contact.link; });
  put_integers("contact_side", [](const RecordedContact& c) { return static_cast<int>(c.contact.side); });
  put_integers("contact_other", [](const RecordedContact& c) { return c.contact.other; });
  put(npz, "contact_point", table(contacts, 3, [](const RecordedContact& c) { return c.contact.p_WC; }));
  put(npz, "contact_force", table(contacts, 3, [](const RecordedContact& c) { return c.contact.f_W; }));
  std::vector<double> depths;
  depths.reserve(count);
  for (const RecordedContact& entry : contacts) depths.push_back(entry.contact.depth);
  npz.set("contact_depth", std::move(depths), {count});
}

// Reads the tables of one file. A run that diverged ends in numbers that are not finite, and they are what it left
// behind: only then are they accepted.
class Reader {
 public:
  Reader(const Npz& npz, bool finite) : npz_(npz), finite_(finite) {}

  // (frames, width) as a matrix of one column per frame; -1 accepts any size.
  [[nodiscard]] Eigen::MatrixXd columns(const std::string& key, long frames, long width) const {
    const std::vector<double> values = numbers(key, {frames, width});
    const std::vector<std::size_t>& shape = npz_.array(key).shape;
    return Eigen::Map<const Eigen::MatrixXd>(values.data(), static_cast<Eigen::Index>(shape[1]),
                                             static_cast<Eigen::Index>(shape[0]));
  }

  [[nodiscard]] std::vector<double> numbers(const std::string& key, const std::vector<long>& shape) const {
    if (finite_) return npz_.numbers(key, shape);
    const NpyArray& array = npz_.array(key);
    const auto* values = std::get_if<std::vector<double>>(&array.values);
    const bool fits = array.shape.size() == shape.size() &&
                      std::equal(shape.begin(), shape.end(), array.shape.begin(), [](long expected, std::size_t found) {
                        return expected < 0 || static_cast<std::size_t>(expected) == found;
                      });
    return values != nullptr && fits ? *values : npz_.numbers(key, shape);  // which says what is wrong
  }

 private:
  const Npz& npz_;
  bool finite_;
};

[[noreturn]] void refuse(const Npz& npz, const std::string& problem) {
  throw InputError(fmt::format("'{}': {}", npz.name(), excerpt(problem, kShownSentence)));
}

// Unit to 1e-6, or not a number (a diverged run: the reader has refused it in any other).
Eigen::Quaterniond unit_quaternion(const Npz& npz, const std::string& key, long frame, const Eigen::Vector4d& wxyz) {
  constexpr double kUnitTolerance = 1e-6;
  if (std::abs(wxyz.norm() - 1.0) > kUnitTolerance)
    refuse(npz, fmt::format("array '{}': expected norm 1, found {} in row {}", key, wxyz.norm(), frame));
  return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

void get_robot(const Npz& npz, const Reader& reader, Recording& recording) {
  const Eigen::MatrixXd q = reader.columns("q", -1, -1);
  const long frames = q.cols(), joints = q.rows();
  const Eigen::MatrixXd v = reader.columns("v", frames, joints), p = reader.columns("root_position", frames, 3),
                        R = reader.columns("root_quat_wxyz", frames, 4),
                        velocity = reader.columns("root_velocity", frames, 3),
                        angular = reader.columns("root_angular_velocity", frames, 3),
                        target = reader.columns("q_target", frames, joints);
  for (long t = 0; t < frames; ++t) {
    const Pose X_WB{unit_quaternion(npz, "root_quat_wxyz", t, R.col(t)), p.col(t)};
    recording.robot.push_back({X_WB, velocity.col(t), angular.col(t), q.col(t), v.col(t)});
    recording.q_target.emplace_back(target.col(t));
  }
}

void get_reference(const Npz& npz, const Reader& reader, Recording& recording) {
  const long frames = recording.frames();
  const long joints = frames == 0 ? -1 : recording.robot.front().q.size();
  const Eigen::MatrixXd p = reader.columns("reference_position", frames, 3),
                        R = reader.columns("reference_quat_wxyz", frames, 4),
                        q = reader.columns("reference_q", frames, joints);
  for (long t = 0; t < frames; ++t)
    recording.reference.push_back({{unit_quaternion(npz, "reference_quat_wxyz", t, R.col(t)), p.col(t)}, q.col(t)});
}

void get_contacts(const Npz& npz, const Reader& reader, Recording& recording) {
  const std::vector<std::int64_t> frame = npz.integers("contact_frame", {-1});
  const long count = static_cast<long>(frame.size());
  const std::vector<std::int64_t> link = npz.integers("contact_link", {count}),
                                  side = npz.integers("contact_side", {count}),
                                  other = npz.integers("contact_other", {count});
  const Eigen::MatrixXd p = reader.columns("contact_point", count, 3), f = reader.columns("contact_force", count, 3);
  const std::vector<double> depth = reader.numbers("contact_depth", {count});
  for (long i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const std::int64_t earliest = i == 0 ? 0 : frame[k - 1];
    if (frame[k] < earliest || frame[k] >= recording.frames())
      refuse(npz, fmt::format("contact {}: expected a frame in {}..{}, found {}", i, earliest, recording.frames() - 1,
                              frame[k]));
    if (side[k] < 0 || side[k] > static_cast<int>(ContactSide::kRobot))
      refuse(npz, fmt::format("contact {}: expected side 0, 1 or 2, found {}", i, side[k]));
    recording.contacts.push_back({static_cast<int>(frame[k]),
                                  {static_cast<int>(link[k]), static_cast<ContactSide>(side[k]),
                                   static_cast<int>(other[k]), p.col(i), f.col(i), depth[k]}});
  }
}

void get_partner(const Npz& npz, const Reader& reader, Recording& recording) {
  if (!npz.contains("partner")) return;
  const int frames = recording.frames();
  recording.partner = {frames, kSmplJoints, reader.numbers("partner", {frames, kSmplJoints, 3})};
}

void get_scalars(const Npz& npz, Recording& recording) {
  if (npz.text("schema") != kSchema || npz.integer("schema_version") != kVersion)
    refuse(npz, fmt::format("expected schema '{}' version {}, found '{}' version {}", kSchema, kVersion,
                            npz.text("schema"), npz.integer("schema_version")));
  try {
    if (const std::string task = npz.text("task"); !task.empty()) recording.task = parse_task(task);
    recording.outcome = parse_outcome(npz.text("outcome"));
  } catch (const std::invalid_argument& error) {
    refuse(npz, error.what());
  }
  recording.message = npz.text("message");
  recording.rate_hz = npz.number("rate_hz");
  if (recording.rate_hz <= 0.0) refuse(npz, fmt::format("expected rate_hz above 0, found {}", recording.rate_hz));
  const std::vector<std::int64_t> phases = npz.integers("phases", {2});
  recording.phases = {static_cast<int>(phases[0]), static_cast<int>(phases[1])};
}

}  // namespace

Npz recording_npz(const Recording& recording) {
  check_sizes(recording);
  const std::size_t joints = recording.robot.empty() ? 0 : static_cast<std::size_t>(recording.robot.front().q.size());
  Npz npz;
  npz.set_text("schema", kSchema);
  npz.set_integer("schema_version", kVersion);
  npz.set_text("task", recording.task ? std::string(to_string(*recording.task)) : "");
  npz.set_text("outcome", std::string(to_string(recording.outcome)));
  npz.set_text("message", recording.message);
  npz.set_number("rate_hz", recording.rate_hz);
  npz.set("phases", std::vector<std::int64_t>{recording.phases.act_begin, recording.phases.act_end}, {2});
  put_robot(npz, recording, joints);
  if (!recording.partner.empty())
    npz.set("partner", recording.partner.data(), {recording.robot.size(), kSmplJoints, 3});
  put_contacts(npz, recording.contacts);
  return npz;
}

Recording read_recording(const Npz& npz) {
  Recording recording;
  get_scalars(npz, recording);
  const Reader reader(npz, recording.outcome != Outcome::kDiverged);
  get_robot(npz, reader, recording);
  get_reference(npz, reader, recording);
  get_partner(npz, reader, recording);
  get_contacts(npz, reader, recording);
  if (!(0 <= recording.phases.act_begin && recording.phases.act_begin <= recording.phases.act_end))
    refuse(npz, fmt::format("phases: expected 0 <= act_begin <= act_end, found {} and {}", recording.phases.act_begin,
                            recording.phases.act_end));
  return recording;
}

void save_recording(const Recording& recording, const std::string& path) { recording_npz(recording).save(path); }

Recording load_recording(const std::string& path) { return read_recording(Npz::load(path)); }

}  // namespace duet
