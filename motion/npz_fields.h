// Fields that the NPZ files of this room share: schema, human motions, maps of text. Getters throw InputError naming
// the archive, the key and the fault.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/motion/human_motion.h"

namespace duet {

// Runs `check` and turns the std::invalid_argument of a validation into an InputError that names the archive.
template <typename Check>
void check_archive(const Npz& npz, Check&& check) {
  try {
    check();
  } catch (const std::invalid_argument& error) {
    throw InputError("'" + npz.name() + "': " + error.what());
  }
}

// "schema" and "schema_version".
void put_schema(Npz& npz, const std::string& schema, std::int64_t version);
// Refuses another schema or version and every key that is neither in `known` nor begins with an entry of `prefixes`.
void check_schema(const Npz& npz, const std::string& schema, std::int64_t version, std::vector<std::string> known,
                  const std::vector<std::string>& prefixes);

// "task", "reactor" ("A" or "B"), "phases" ([act_begin, act_end]), "rate_hz".
void put_task(Npz& npz, Task task, Person reactor, const Phases& phases, double rate_hz);
// 1 to 200 printable characters.
std::string get_id(const Npz& npz, const std::string& key);
Task get_task(const Npz& npz);
Person get_reactor(const Npz& npz);
Phases get_phases(const Npz& npz);
inline constexpr double kLowestPeopleRate = 5.0;  // of motions of people [Hz]
double get_rate(const Npz& npz);

// "human_joint_names": the 24 names, in the order of the columns of every human motion in the archive.
void put_joint_names(Npz& npz);
// For each SMPL joint the column that holds it. Any order is accepted; a missing, unknown or doubled name is not.
std::vector<int> get_joint_columns(const Npz& npz);

// "<who>_joints" (T, 24, 3) and, where known, "<who>_rotations_wxyz" (T, 24, 4).
void put_motion(Npz& npz, const std::string& who, const HumanMotion& motion);
HumanMotion get_motion(const Npz& npz, const std::string& who, double rate_hz, const std::vector<int>& columns);

// "<key>_names" and "<key>_values", both absent where the map is empty.
void put_texts(Npz& npz, const std::string& key, const std::map<std::string, std::string>& texts);
std::map<std::string, std::string> get_texts(const Npz& npz, const std::string& key);

// (T, 4) wxyz.
void put_quaternions(Npz& npz, const std::string& key, const std::vector<Eigen::Quaterniond>& rotations,
                     const std::vector<std::size_t>& shape);
std::vector<Eigen::Quaterniond> get_quaternions(const Npz& npz, const std::string& key, const std::vector<long>& shape);

}  // namespace duet
