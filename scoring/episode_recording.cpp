#include "duet/scoring/episode_recording.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/archives/recording_file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/experiment/suite/suite_names.h"
#include "duet/motion/npz_fields.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr const char* kRow = "row";

template <typename E>
E parse_name(const Npz& npz, const std::string& key, const NameTable<E>& names) {
  const std::string found = npz.text(key);
  for (const auto& [name, value] : names)
    if (name == found) return value;
  throw InputError(fmt::format("'{}': key '{}': unknown name '{}'", npz.name(), key, shown(found)));
}

// Options that are not as by default.
std::map<std::string, std::string> chosen_readings(const Readings& readings) {
  std::map<std::string, std::string> chosen;
  for (const std::string& option : reading_names())
    if (reading(readings, option) != reading({}, option)) chosen[option] = reading(readings, option);
  return chosen;
}

void put_kept(Npz& npz, const KeptEpisode& kept) {
  npz.set_text(kRow, dumped(to_json(kept.row)));
  npz.set_text("detector_version", std::string(to_string(kept.rules.detector)));
  npz.set_text("detector_thresholds", std::string(to_string(kept.rules.thresholds)));
  npz.set_integer("feet", kept.rules.feet ? 1 : 0);
  put_texts(npz, "readings", chosen_readings(kept.rules.readings));
  npz.set("act_partner", kept.source.partner.joints);
  npz.set("act_reactor", kept.source.reactor.joints);
  if (!kept.source.reshaped.empty()) npz.set("act_reshaped", kept.source.reshaped);
}

EpisodeRow get_row(const Npz& npz) {
  try {
    return row_from_json(parse_json(npz.text(kRow), "expected a row"));
  } catch (const InputError& error) {
    throw InputError(fmt::format("'{}': key '{}': {}", npz.name(), kRow, error.what()));
  }
}

ScoringRules get_rules(const Npz& npz) {
  ScoringRules rules{parse_name(npz, "detector_version", version_names()),
                     parse_name(npz, "detector_thresholds", threshold_names()),
                     {},
                     npz.integer("feet") != 0};
  check_archive(npz, [&] {
    for (const auto& [option, value] : get_texts(npz, "readings")) set_reading(rules.readings, option, value);
  });
  return rules;
}

// Frames of the act that the recording has.
int act_frames(const Recording& recording) {
  return std::min(recording.phases.act_end, recording.frames()) -
         std::min(recording.phases.act_begin, recording.frames());
}

ActSource get_source(const Npz& npz, const Recording& recording) {
  ActSource source;
  source.partner.joints = npz.tracks("act_partner", kSmplJoints);
  source.reactor.joints = npz.tracks("act_reactor", kSmplJoints);
  if (npz.contains("act_reshaped")) source.reshaped = npz.tracks("act_reshaped", -1);
  for (const PointTracks* tracks : {&source.partner.joints, &source.reactor.joints, &source.reshaped}) {
    if (tracks->frames() != act_frames(recording) && !(tracks == &source.reshaped && tracks->empty()))
      throw InputError(
          fmt::format("'{}': expected the act's {} frames in 'act_partner', 'act_reactor' and "
                      "'act_reshaped', found {}",
                      npz.name(), act_frames(recording), tracks->frames()));
  }
  return source;
}

}  // namespace

void save_episode_recording(const EpisodeRecording& episode, const std::string& path) {
  Npz npz = recording_npz(episode.recording);
  if (episode.kept) put_kept(npz, *episode.kept);
  npz.save(path);
}

EpisodeRecording read_episode_recording(const Npz& npz) {
  EpisodeRecording episode{read_recording(npz), std::nullopt};
  if (!npz.contains(kRow)) return episode;
  episode.kept = KeptEpisode{get_row(npz), get_rules(npz), get_source(npz, episode.recording)};
  if (episode.recording.partner.empty())
    throw InputError(fmt::format("'{}': expected the key 'partner' beside a row, found none", npz.name()));
  return episode;
}

EpisodeRow score_again(const Recording& recording, const KeptEpisode& kept, const RobotModel& robot) {
  EpisodeRow row = kept.row;
  if (row.robot_digest != robot.digest)
    throw InputError(fmt::format("expected the robot card of digest {:.8} (of {}/{}), found '{}' of digest {:.8}",
                                 row.robot_digest, row.engine, row.controller, robot.name, robot.digest));
  row.verdicts.clear();
  row.metrics.clear();
  for (const std::string& name : measured_metrics())
    if (const auto found = kept.row.metrics.find(name); found != kept.row.metrics.end())
      row.metrics[name] = found->second;
  row.state_hash = state_hash(recording);
  score_recording(recording, kept.source, kept.rules, robot, row);
  return row;
}

}  // namespace duet
