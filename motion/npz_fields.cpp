#include "duet/motion/npz_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

[[noreturn]] void refuse(const Npz& npz, const std::string& key, const std::string& fault) {
  throw InputError(fmt::format("'{}': key '{}': {}", npz.name(), excerpt(key), fault));
}

int checked_frame(const Npz& npz, const std::string& key, std::int64_t value) {
  if (value < 0 || value > 1'000'000'000) refuse(npz, key, fmt::format("expected a frame number, found {}", value));
  return static_cast<int>(value);
}

std::vector<std::string> smpl_names() { return {kSmplNames.begin(), kSmplNames.end()}; }

}  // namespace

void put_schema(Npz& npz, const std::string& schema, std::int64_t version) {
  npz.set_text("schema", schema);
  npz.set_integer("schema_version", version);
}

void check_schema(const Npz& npz, const std::string& schema, std::int64_t version, std::vector<std::string> known,
                  const std::vector<std::string>& prefixes) {
  const std::string found = npz.text("schema");
  if (found != schema) refuse(npz, "schema", fmt::format("expected '{}', found '{}'", schema, excerpt(found)));
  const std::int64_t found_version = npz.integer("schema_version");
  if (found_version != version)
    refuse(npz, "schema_version", fmt::format("expected {}, found {}", version, found_version));
  known.insert(known.end(), {"schema", "schema_version"});
  for (const std::string& key : npz.keys()) {
    const auto begins_key = [&](const std::string& prefix) { return key.starts_with(prefix); };
    if (std::find(known.begin(), known.end(), key) == known.end() &&
        std::none_of(prefixes.begin(), prefixes.end(), begins_key))
      throw InputError(fmt::format("'{}': {}", npz.name(), unknown_name_message("key", key, known)));
  }
}

void put_task(Npz& npz, Task task, Person reactor, const Phases& phases, double rate_hz) {
  npz.set_text("task", std::string(to_string(task)));
  npz.set_text("reactor", reactor == Person::kA ? "A" : "B");
  npz.set("phases", std::vector<std::int64_t>{phases.act_begin, phases.act_end}, {2});
  npz.set_number("rate_hz", rate_hz);
}

std::string get_id(const Npz& npz, const std::string& key) {
  constexpr std::size_t kLongestId = 200;  // [bytes]: an id stands in names of files and in every row
  std::string id = npz.text(key);
  if (id.empty() || excerpt(id, kLongestId) != id)
    refuse(npz, key, fmt::format("expected 1 to {} printable characters, found '{}'", kLongestId, excerpt(id)));
  return id;
}

Task get_task(const Npz& npz) {
  const std::string name = npz.text("task");
  try {
    return parse_task(name);
  } catch (const std::invalid_argument& error) {
    refuse(npz, "task", error.what());
  }
}

Person get_reactor(const Npz& npz) {
  const std::string name = npz.text("reactor");
  if (name != "A" && name != "B") refuse(npz, "reactor", fmt::format("expected 'A' or 'B', found '{}'", excerpt(name)));
  return name == "A" ? Person::kA : Person::kB;
}

Phases get_phases(const Npz& npz) {
  const std::vector<std::int64_t> values = npz.integers("phases", {2});
  return {.act_begin = checked_frame(npz, "phases", values[0]), .act_end = checked_frame(npz, "phases", values[1])};
}

double get_rate(const Npz& npz) {
  const double rate_hz = npz.number("rate_hz");
  if (!(rate_hz > 0.0)) refuse(npz, "rate_hz", fmt::format("expected a positive rate, found {}", rate_hz));
  if (rate_hz < kLowestPeopleRate)
    refuse(npz, "rate_hz",
           fmt::format("expected {} Hz or more, as people's motions have, found {}", kLowestPeopleRate, rate_hz));
  return rate_hz;
}

void put_joint_names(Npz& npz) { npz.set("human_joint_names", smpl_names()); }

std::vector<int> get_joint_columns(const Npz& npz) {
  const std::string key = "human_joint_names";
  const std::vector<std::string> names = npz.strings(key, {kSmplJoints});
  std::vector<int> columns(kSmplJoints, -1);
  for (int column = 0; column < kSmplJoints; ++column) {
    const int joint = smpl_index(names[column]);
    if (joint < 0) refuse(npz, key, unknown_name_message("joint", names[column], smpl_names()));
    if (columns[joint] >= 0) refuse(npz, key, fmt::format("joint '{}' is there twice", excerpt(names[column])));
    columns[joint] = column;
  }
  return columns;
}

void put_motion(Npz& npz, const std::string& who, const HumanMotion& motion) {
  npz.set(who + "_joints", motion.joints);
  if (motion.rotations.empty()) return;
  put_quaternions(npz, who + "_rotations_wxyz", motion.rotations,
                  {static_cast<std::size_t>(motion.frames()), kSmplJoints, 4});
}

HumanMotion get_motion(const Npz& npz, const std::string& who, double rate_hz, const std::vector<int>& columns) {
  HumanMotion motion{
      .rate_hz = rate_hz, .joints = npz.tracks(who + "_joints", kSmplJoints).select(columns), .rotations = {}};
  const std::string key = who + "_rotations_wxyz";
  if (npz.contains(key)) {
    const std::vector<Eigen::Quaterniond> stored = get_quaternions(npz, key, {motion.frames(), kSmplJoints, 4});
    motion.rotations.reserve(stored.size());
    for (int t = 0; t < motion.frames(); ++t)
      for (const int column : columns)
        motion.rotations.push_back(stored[static_cast<std::size_t>(t) * kSmplJoints + column]);
  }
  check_archive(npz, [&] { validate(motion, fmt::format("key '{}_joints'", who)); });
  return motion;
}

void put_texts(Npz& npz, const std::string& key, const std::map<std::string, std::string>& texts) {
  if (texts.empty()) return;
  std::vector<std::string> names, values;
  for (const auto& [name, value] : texts) {
    names.push_back(name);
    values.push_back(value);
  }
  npz.set(key + "_names", std::move(names));
  npz.set(key + "_values", std::move(values));
}

std::map<std::string, std::string> get_texts(const Npz& npz, const std::string& key) {
  std::map<std::string, std::string> texts;
  if (!npz.contains(key + "_names") && !npz.contains(key + "_values")) return texts;
  const std::vector<std::string> names = npz.strings(key + "_names", {-1});
  const std::vector<std::string> values = npz.strings(key + "_values", {static_cast<long>(names.size())});
  for (std::size_t i = 0; i < names.size(); ++i)
    if (!texts.emplace(names[i], values[i]).second)
      refuse(npz, key + "_names", fmt::format("'{}' is there twice", excerpt(names[i])));
  return texts;
}

void put_quaternions(Npz& npz, const std::string& key, const std::vector<Eigen::Quaterniond>& rotations,
                     const std::vector<std::size_t>& shape) {
  std::vector<double> quat_wxyz;
  quat_wxyz.reserve(4 * rotations.size());
  for (const Eigen::Quaterniond& R : rotations) quat_wxyz.insert(quat_wxyz.end(), {R.w(), R.x(), R.y(), R.z()});
  npz.set(key, std::move(quat_wxyz), shape);
}

std::vector<Eigen::Quaterniond> get_quaternions(const Npz& npz, const std::string& key,
                                                const std::vector<long>& shape) {
  const std::vector<double> quat_wxyz = npz.numbers(key, shape);
  std::vector<Eigen::Quaterniond> rotations;
  rotations.reserve(quat_wxyz.size() / 4);
  for (std::size_t i = 0; i + 3 < quat_wxyz.size(); i += 4)
    rotations.emplace_back(quat_wxyz[i], quat_wxyz[i + 1], quat_wxyz[i + 2], quat_wxyz[i + 3]);
  return rotations;
}

}  // namespace duet
