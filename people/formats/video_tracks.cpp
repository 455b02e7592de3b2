#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "duet/archives/pickle/pickle_files.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/people/bodies/body_model.h"
#include "duet/people/body_people.h"
#include "duet/people/people_format.h"
#include "duet/people/video_person.h"

namespace duet {
namespace {

constexpr double kVideoRate = 30.0;
constexpr std::size_t kMostTracks = 1000;
constexpr std::size_t kVideoRecognitionBytes = std::size_t{1} << 20;
constexpr double kMostFrameNumber = 1e9;
constexpr double kRotationTolerance = 0.1;  // of a matrix from the nearest rotation, largest element

// One person's place in the file, by the frame of the video.
struct Track {
  std::int64_t id = 0;
  std::map<std::int64_t, int> rows;  // frame of the video -> row of the track
};

struct Stretch {
  std::size_t a = 0, b = 0;  // tracks
  std::int64_t begin = 0;    // frame of the video
  int frames = 0;
};

// The longest run of consecutive frames in which both are there.
Stretch common_stretch(const Track& a, const Track& b) {
  Stretch best, run;
  for (const auto& [frame, row] : a.rows) {
    if (!b.rows.contains(frame)) continue;
    if (run.frames > 0 && run.begin + run.frames == frame)
      ++run.frames;
    else
      run = {.begin = frame, .frames = 1};
    if (run.frames > best.frames) best = run;
  }
  return best;
}

Stretch longest_stretch(const std::string& name, const std::vector<Track>& tracks, std::vector<std::string>& evidence) {
  if (tracks.size() < 2)
    throw InputError(fmt::format("'{}': expected two people, found {}", excerpt(name), tracks.size()));
  Stretch best;
  for (std::size_t a = 0; a < tracks.size(); ++a)
    for (std::size_t b = a + 1; b < tracks.size(); ++b) {
      Stretch stretch = common_stretch(tracks[a], tracks[b]);
      stretch.a = a, stretch.b = b;
      if (stretch.frames > best.frames) best = stretch;
    }
  if (best.frames < 2)
    throw InputError(fmt::format("'{}': no two of its {} people are in the picture at once for 2 frames", excerpt(name),
                                 tracks.size()));
  evidence.push_back(
      fmt::format("people: tracks {} (A) and {} (B) of {}, frames {} to {} of the video, in which both are "
                  "there",
                  tracks[best.a].id, tracks[best.b].id, tracks.size(), best.begin, best.begin + best.frames - 1));
  return best;
}

RawPeople video_people(const ClipPlace& place) {
  RawPeople raw{.id = place.id, .name = place.files[0], .joints = {}};
  raw.rate_hz = kVideoRate;
  raw.metres_per_unit = 1.0;
  return raw;
}

bool is_video_pickle_name(const std::string& name) { return name.ends_with(".pkl"); }

bool is_joblib(const std::string& bytes) {
  return bytes.starts_with('\x80') || bytes.starts_with('\x78') || bytes.starts_with("\x1f\x8b");
}

// ---- WHAM ------------------------------------------------------------

bool is_wham_file(const std::string& path) {
  const std::string bytes = leading_bytes(path, kVideoRecognitionBytes);
  return is_joblib(bytes) &&
         (bytes.find("pose_world") != std::string::npos || file_stem(path).find("wham_output") != std::string::npos);
}

bool recognises_wham(std::span<const std::string> paths) {
  return !paths.empty() && std::all_of(paths.begin(), paths.end(), [](const std::string& path) {
    const std::string first = first_file_at(path, is_video_pickle_name);
    return !first.empty() && is_wham_file(first);
  });
}

std::vector<ClipPlace> find_wham(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  return clips_at(paths, is_video_pickle_name, "WHAM (wham_output.pkl)");
}

const PickleNode& dict_value(const Pickle& pickle, const PickleNode& dict, const std::string& key) {
  if (const PickleNode* node = pickle.find(dict, key)) return *node;
  pickle.fail(dict.offset, fmt::format("expected a dict with the key '{}', found {}", key,
                                       dict.kind == PickleKind::kDict ? "a dict without it" : to_string(dict.kind)));
}

std::int64_t person_number(const Pickle& pickle, const PickleNode& node) {
  if (node.kind == PickleKind::kInt) return node.integer;
  const std::vector<double> values = array_values(pickle, node, "number of a person");
  if (values.size() != 1 || !(std::abs(values[0]) < kMostFrameNumber))
    pickle.fail(node.offset, "number of a person: expected one whole number");
  return static_cast<std::int64_t>(values[0]);
}

Track wham_track(const Pickle& pickle, std::int64_t id, const PickleNode& person) {
  const NumberTable frames = table_of(pickle, dict_value(pickle, person, "frame_ids"), "'frame_ids'");
  Track track{.id = id, .rows = {}};
  for (std::size_t i = 0; i < frames.values.size(); ++i) {
    if (!(std::abs(frames.values[i]) < kMostFrameNumber) || frames.values[i] != std::floor(frames.values[i]))
      frames.fail(fmt::format("expected frame numbers, found {}", frames.values[i]));
    if (!track.rows.emplace(static_cast<std::int64_t>(frames.values[i]), static_cast<int>(i)).second)
      frames.fail(fmt::format("frame {} is there twice", frames.values[i]));
  }
  return track;
}

// Rows of a table where they lie in the stretch.
NumberTable in_stretch(const NumberTable& table, const Track& track, const Stretch& stretch) {
  checked_rows(table, {3, 72}, "(T, 3) or (T, 72)", static_cast<int>(track.rows.size()));
  const std::size_t width = table.values.size() / table.shape[0];
  NumberTable part{.what = table.what, .shape = {static_cast<std::size_t>(stretch.frames), width}, .values = {}};
  for (int i = 0; i < stretch.frames; ++i) {
    const auto row = table.values.begin() +
                     static_cast<std::ptrdiff_t>(width * static_cast<std::size_t>(track.rows.at(stretch.begin + i)));
    part.values.insert(part.values.end(), row, row + static_cast<std::ptrdiff_t>(width));
  }
  return part;
}

BodyMotion wham_motion(const Pickle& pickle, const PickleNode& person, const Track& track, const Stretch& stretch) {
  const auto table = [&](const std::string& key) {
    return table_of(pickle, dict_value(pickle, person, key), fmt::format("'{}' of person {}", key, track.id));
  };
  const NumberTable pose = in_stretch(table("pose_world"), track, stretch);
  if (pose.shape[1] != 72) pose.fail("expected shape (T, 72)");
  BodyMotion motion = body_motion(pickle.name, columns_of(pose, 0, 3), columns_of(pose, 3, 69),
                                  in_stretch(table("trans_world"), track, stretch));
  if (pickle.find(person, "betas") != nullptr) motion.betas = mean_betas(table("betas"));
  return motion;
}

RawPeople read_wham(const ClipPlace& place, const PeopleOptions& options) {
  const std::string bytes = read_data(place.files[0]);
  const Pickle pickle = parse_joblib(bytes, place.files[0]);
  const PickleNode& root = pickle[pickle.root];
  if (root.kind != PickleKind::kDict)
    pickle.fail(root.offset, fmt::format("expected a dict of people, found {}", to_string(root.kind)));
  if (root.items.size() / 2 > kMostTracks) pickle.fail(root.offset, "expected at most 1000 people");
  std::vector<Track> tracks;
  for (std::size_t i = 0; i + 1 < root.items.size(); i += 2)
    tracks.push_back(wham_track(pickle, person_number(pickle, pickle[root.items[i]]), pickle[root.items[i + 1]]));
  RawPeople raw = video_people(place);
  raw.up = Axis::kPlusY;
  raw.evidence.emplace_back("layout: WHAM, pose_world and trans_world: y up, metres");
  raw.evidence.emplace_back("rate: 30 Hz, as most videos (the file does not say; state the rate where it is another)");
  const Stretch stretch = longest_stretch(pickle.name, tracks, raw.evidence);
  const auto person = [&](std::size_t which) {
    return wham_motion(pickle, pickle[root.items[2 * which + 1]], tracks[which], stretch);
  };
  add_people(raw, {.format = "wham", .licence = "", .people = {person(stretch.a), person(stretch.b)}, .apart = true},
             options);
  return raw;
}

// ---- 4D-Humans ------------------------------------------------------------

bool is_phalp_file(const std::string& path) {
  const std::string bytes = leading_bytes(path, kVideoRecognitionBytes);
  return is_joblib(bytes) && bytes.find("global_orient") != std::string::npos && bytes.find("tid") != std::string::npos;
}

bool recognises_phalp(std::span<const std::string> paths) {
  return !paths.empty() && std::all_of(paths.begin(), paths.end(), [](const std::string& path) {
    const std::string first = first_file_at(path, is_video_pickle_name);
    return !first.empty() && is_phalp_file(first);
  });
}

std::vector<ClipPlace> find_phalp(std::span<const std::string> paths, const PeopleOptions& /*options*/) {
  return clips_at(paths, is_video_pickle_name, "4D-Humans (.pkl)");
}

// The content of one frame of the video: lists of the same order.
struct PhalpFrame {
  const PickleNode* smpl;    // one dict a person
  const PickleNode* camera;  // one (3,) a person
};

const PickleNode& list_of(const Pickle& pickle, const PickleNode& frame, const std::string& key, std::size_t least) {
  const PickleNode& list = dict_value(pickle, frame, key);
  if ((list.kind != PickleKind::kList && list.kind != PickleKind::kTuple) || list.items.size() < least)
    pickle.fail(list.offset, fmt::format("'{}': expected a list of {} people, found {} of {}", key, least,
                                         to_string(list.kind), list.items.size()));
  return list;
}

void add_phalp_frame(const Pickle& pickle, const PickleNode& frame, std::int64_t number, std::vector<Track>& tracks,
                     std::vector<PhalpFrame>& frames) {
  const PickleNode& ids = list_of(pickle, frame, "tid", 0);
  frames.push_back({.smpl = &list_of(pickle, frame, "smpl", ids.items.size()),
                    .camera = &list_of(pickle, frame, "camera", ids.items.size())});
  for (std::size_t i = 0; i < ids.items.size(); ++i) {
    const std::int64_t id = person_number(pickle, pickle[ids.items[i]]);
    auto track = std::find_if(tracks.begin(), tracks.end(), [&](const Track& known) { return known.id == id; });
    if (track == tracks.end()) {
      if (tracks.size() >= kMostTracks) pickle.fail(ids.offset, "expected at most 1000 people");
      track = tracks.insert(tracks.end(), {.id = id, .rows = {}});
    }
    track->rows.emplace(number, static_cast<int>(i));
  }
}

Eigen::Quaterniond rotation_of_matrix(const NumberTable& table, std::size_t which) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(&table.values[9 * which]);
  const Eigen::Quaterniond q = Eigen::Quaterniond(Eigen::Matrix3d(R)).normalized();
  if (!((q.toRotationMatrix() - R).cwiseAbs().maxCoeff() <= kRotationTolerance))
    table.fail(fmt::format("expected rotation matrices, number {} is none", which));
  return q;
}

// The person at those frames of the video, in all of which they are there.
BodyMotion phalp_motion(const Pickle& pickle, const std::vector<PhalpFrame>& frames, const Track& track,
                        std::span<const std::int64_t> numbers) {
  BodyMotion motion{.file = pickle.name};
  motion.local.assign(numbers.size() * kSmplJoints, Eigen::Quaterniond::Identity());
  std::vector<double> sum;
  for (std::size_t t = 0; t < numbers.size(); ++t) {
    const PhalpFrame& frame = frames[static_cast<std::size_t>(numbers[t])];
    const auto place = static_cast<std::size_t>(track.rows.at(numbers[t]));
    const PickleNode& smpl = pickle[frame.smpl->items[place]];
    const NumberTable root = table_of(pickle, dict_value(pickle, smpl, "global_orient"), "'global_orient'");
    const NumberTable body = table_of(pickle, dict_value(pickle, smpl, "body_pose"), "'body_pose'");
    const NumberTable camera = table_of(pickle, pickle[frame.camera->items[place]], "'camera'");
    if (root.values.size() != 9) root.fail(fmt::format("expected shape (1, 3, 3), found {}", root.found()));
    if (body.values.size() != 23 * 9) body.fail(fmt::format("expected shape (23, 3, 3), found {}", body.found()));
    if (camera.values.size() != 3) camera.fail(fmt::format("expected shape (3,), found {}", camera.found()));
    Eigen::Quaterniond* local = &motion.local[t * kSmplJoints];
    local[kPelvis] = rotation_of_matrix(root, 0);
    for (std::size_t j = 1; j < kSmplJoints; ++j) local[j] = rotation_of_matrix(body, j - 1);
    motion.translation.emplace_back(camera.values[0], camera.values[1], camera.values[2]);
    const std::vector<double> betas = mean_betas(table_of(pickle, dict_value(pickle, smpl, "betas"), "'betas'"));
    sum.resize(std::max(sum.size(), betas.size()));
    for (std::size_t b = 0; b < betas.size(); ++b) sum[b] += betas[b] / static_cast<double>(numbers.size());
  }
  motion.betas = std::move(sum);
  return motion;
}

std::vector<Track> phalp_tracks(const Pickle& pickle, std::vector<PhalpFrame>& frames) {
  const PickleNode& root = pickle[pickle.root];
  if (root.kind != PickleKind::kDict)
    pickle.fail(root.offset, fmt::format("expected a dict of frames, found {}", to_string(root.kind)));
  std::vector<Track> tracks;
  for (std::size_t i = 0; i + 1 < root.items.size(); i += 2)
    add_phalp_frame(pickle, pickle[root.items[i + 1]], static_cast<std::int64_t>(i / 2), tracks, frames);
  return tracks;
}

RawPeople read_phalp(const ClipPlace& place, const PeopleOptions& options) {
  const std::string bytes = read_data(place.files[0]);
  const Pickle pickle = parse_joblib(bytes, place.files[0]);
  std::vector<PhalpFrame> frames;
  const std::vector<Track> tracks = phalp_tracks(pickle, frames);
  RawPeople raw = video_people(place);
  raw.evidence.emplace_back("layout: 4D-Humans (PHALP), rotation matrices in the camera's frame; depths are guesses");
  raw.evidence.emplace_back("rate: 30 Hz, as most videos (the file does not say; state the rate where it is another)");
  const Stretch stretch = longest_stretch(pickle.name, tracks, raw.evidence);
  std::vector<std::int64_t> numbers(static_cast<std::size_t>(stretch.frames));
  std::iota(numbers.begin(), numbers.end(), stretch.begin);
  add_people(raw,
             {.format = "4d-humans",
              .licence = "",
              .people = {phalp_motion(pickle, frames, tracks[stretch.a], numbers),
                         phalp_motion(pickle, frames, tracks[stretch.b], numbers)},
              .apart = true},
             options);
  return raw;
}

// The pelvis' mean distance along the camera's axis, by the numbers of the file.
double phalp_depth(const Pickle& pickle, const std::vector<PhalpFrame>& frames, const Track& track) {
  double sum = 0.0;
  for (const auto& [number, place] : track.rows) {
    const PickleNode& camera =
        pickle[frames[static_cast<std::size_t>(number)].camera->items[static_cast<std::size_t>(place)]];
    const NumberTable values = table_of(pickle, camera, "'camera'");
    if (values.values.size() != 3) values.fail(fmt::format("expected shape (3,), found {}", values.found()));
    sum += values.values[2];
  }
  return sum / static_cast<double>(track.rows.size());
}

}  // namespace

VideoPerson read_phalp_person(const std::string& path, const VideoPersonOptions& options) {
  const std::string bytes = read_data(path);
  const Pickle pickle = parse_joblib(bytes, path);
  std::vector<PhalpFrame> frames;
  const std::vector<Track> tracks = phalp_tracks(pickle, frames);
  if (tracks.empty()) throw InputError(fmt::format("'{}': expected a person, found nobody", excerpt(path)));
  const Track* best = nullptr;
  for (const Track& track : tracks)
    if (best == nullptr || track.rows.size() > best->rows.size() ||
        (track.rows.size() == best->rows.size() &&
         phalp_depth(pickle, frames, track) < phalp_depth(pickle, frames, *best)))
      best = &track;
  std::vector<std::int64_t> numbers;
  for (const auto& [number, place] : best->rows) numbers.push_back(number);
  BodyMotion motion = phalp_motion(pickle, frames, *best, numbers);
  for (Eigen::Vector3d& place : motion.translation) place.z() *= options.depth_scale;
  VideoPerson person{.format = "4d-humans",
                     .rate_hz = options.rate_hz.value_or(kVideoRate),
                     .joints = PointTracks(static_cast<int>(frames.size()), kSmplJoints),
                     .seen = std::vector<bool>(frames.size(), false),
                     .evidence = fmt::format("4D-Humans (PHALP): track {} of {}, seen in {} of {} frames", best->id,
                                             tracks.size(), numbers.size(), frames.size())};
  const PointTracks posed =
      pose_motion(motion, options.body_model.empty() ? average_body() : load_body_model(options.body_model));
  for (std::size_t t = 0; t < numbers.size(); ++t) {
    person.joints.frame(static_cast<int>(numbers[t])) = posed.frame(static_cast<int>(t));
    person.seen[static_cast<std::size_t>(numbers[t])] = true;
  }
  return person;
}

bool is_video_person(const std::string& path) {
  return (path.ends_with(".pkl") && is_phalp_file(path)) || (path.ends_with(".pt") && is_torch_person(path));
}

VideoPerson read_video_person(const std::string& path, const VideoPersonOptions& options) {
  if (path.ends_with(".pkl") && is_phalp_file(path)) return read_phalp_person(path, options);
  if (path.ends_with(".pt") && is_torch_person(path)) return read_gvhmr_person(path, options);
  throw InputError(
      fmt::format("'{}': expected a file of 4D-Humans with PHALP (.pkl) or GVHMR (.pt), found another", excerpt(path)));
}

const PeopleFormat& wham_format() {
  static const PeopleFormat format{.name = "wham",
                                   .what = "WHAM: the people of one video (wham_output.pkl), --align",
                                   .licence = "",
                                   .recognises = recognises_wham,
                                   .find = find_wham,
                                   .read = read_wham};
  return format;
}

const PeopleFormat& four_d_humans_format() {
  static const PeopleFormat format{.name = "4d-humans",
                                   .what = "4D-Humans (PHALP): the people of one video (.pkl), --align",
                                   .licence = "",
                                   .recognises = recognises_phalp,
                                   .find = find_phalp,
                                   .read = read_phalp};
  return format;
}

}  // namespace duet
