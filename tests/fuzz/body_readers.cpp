// Containers of other programs (joblib, torch.save, NumPy's objects), and two people as parameters of body models.
#include <algorithm>

#include "duet/archives/pickle/pickle_files.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/file.h"
#include "duet/people/bodies/body_model.h"
#include "duet/people/bodies/number_table.h"
#include "duet/people/formats/inter/inter_x.h"
#include "duet/people/hdf5/hdf5.h"
#include "duet/people/people_format.h"
#include "duet/people/video_person.h"
#include "tests/fuzz/archive_edit.h"
#include "tests/fuzz/reader.h"
#include "tests/people/body_files.h"
#include "tests/people/body_model_files.h"

namespace duet::fuzz {
namespace {

test::BodyParameters fuzz_body(double seed, int body_joints = 21) {
  return test::body_parameters(3, seed, body_joints, {seed, 0.0, 0.0});
}

// The file stands for both people where a format has one file for each.
void read_people(const PeopleFormat& format, const std::string& name, std::string_view bytes) {
  const std::string path = scratch_file(name, bytes);
  PeopleOptions options;
  options.align = Alignment::kFloor;
  (void)format.read({.id = "fuzz", .files = {path, path}, .entry = ""}, options);
}

std::string inter_x_sample(unsigned seed) {
  return seed % 2 == 0 ? test::inter_x_npz(fuzz_body(0.3), seed % 4 == 0).bytes() : std::string(kEdit);
}
void read_inter_x_file(std::string_view bytes) {
  static const Npz sample = test::inter_x_npz(fuzz_body(0.3));
  read_people(inter_x_format(), "P1.npz", archive_of(sample, bytes));
}

std::string inter_x_h5_sample(unsigned /*seed*/) {
  return test::inter_x_h5("G001T000A001R000", fuzz_body(0.3), fuzz_body(1.2));
}
void read_inter_x_h5_file(std::string_view bytes) {
  const std::vector<std::string> paths = {scratch_file("train.h5", bytes)};
  for (const ClipPlace& place : inter_x_h5_format().find(paths, {})) (void)inter_x_h5_format().read(place, {});
}

// A file that HDF5's own library wrote: filters, chunks, both kinds of headers.
std::string hdf5_sample(unsigned seed) {
  return read_file(std::string(DUET_SOURCE_DIR "/tests/archives/hdf5/library") + (seed % 2 == 0 ? "" : "_18") + ".h5");
}
void read_hdf5_file(std::string_view bytes) {
  Hdf5File file(scratch_file("a.h5", bytes));
  for (const char* name : {"plain", "double_big", "chunks", "deflated", "all_filters", "compact"}) {
    const std::vector<std::string> names = file.names();
    if (std::find(names.begin(), names.end(), name) != names.end()) (void)file.array(name);
  }
}

std::string amass_sample(unsigned seed) {
  if (seed % 2 != 0) return std::string(kEdit);
  return (seed % 4 == 0 ? test::amass_poses_npz(fuzz_body(0.3)) : test::amass_stageii_npz(fuzz_body(0.3))).bytes();
}
void read_amass_file(std::string_view bytes) {
  static const Npz sample = test::amass_poses_npz(fuzz_body(0.3));
  read_people(amass_format(), "a_poses.npz", archive_of(sample, bytes));
}

std::string interhuman_sample(unsigned seed) {
  return test::interhuman_pickle(fuzz_body(0.3), fuzz_body(1.2), 2 + static_cast<int>(seed % 3), 60.0);
}
void read_interhuman_file(std::string_view bytes) { read_people(interhuman_raw_format(), "1.pkl", bytes); }

std::string motion_x_sample(unsigned /*seed*/) { return test::motion_x_npy(fuzz_body(0.3)); }
void read_motion_x_file(std::string_view bytes) { read_people(motion_x_format(), "a.npy", bytes); }

// The world's people, or the camera's person.
std::string gvhmr_sample(unsigned seed) {
  return test::gvhmr_pt(fuzz_body(0.3), seed / 64 % 2 == 0 ? "smpl_params_global" : "smpl_params_incam");
}
void read_gvhmr_file(std::string_view bytes) {
  try {
    (void)read_gvhmr_person(scratch_file("a.pt", bytes), {});
  } catch (const InputError&) {
    read_people(gvhmr_format(), "a.pt", bytes);
  }
}

std::string wham_sample(unsigned /*seed*/) {
  return test::wham_pkl({{0, 0, fuzz_body(0.3, 23)}, {1, 1, fuzz_body(1.2, 23)}});
}
void read_wham_file(std::string_view bytes) { read_people(wham_format(), "wham_output.pkl", bytes); }

std::string phalp_sample(unsigned /*seed*/) {
  return test::phalp_pkl({{1, 0, fuzz_body(0.3, 23)}, {2, 0, fuzz_body(1.2, 23)}}, 3);
}
void read_phalp_file(std::string_view bytes) {
  (void)read_phalp_person(scratch_file("video.pkl", bytes), {});
  read_people(four_d_humans_format(), "video.pkl", bytes);
}

std::string body_model_sample(unsigned seed) {
  const test::SmallModel small(24);
  if (seed % 3 == 0) return small.npz().bytes();
  return small.pickle(seed % 3 == 1 ? test::SmallModel::Matrix::kColumns : test::SmallModel::Matrix::kRows,
                      seed % 2 == 0);
}
void read_body_model(std::string_view bytes) {
  std::remove((scratch_folder() + "/model.bin.duet-joints.npz").c_str());
  (void)load_body_model(scratch_file("model.bin", bytes));
}

// data.pkl alone: a zip's checksums keep a fuzzer from reaching it.
std::string torch_pickle_sample(unsigned /*seed*/) {
  test::TorchWriter out;
  out.pickle.raw("}(").text("x");
  out.floats(2, 3, {1, 2, 3, 4, 5, 6}, true);
  return out.pickle.raw("u.").str();
}
void read_torch_pickle_bytes(std::string_view bytes) {
  TorchFile file;
  file.pickle = parse_pickle(bytes, "fuzz.pt", PickleFlavour::kTorch);
  file.storages["0"] = std::string(24, '\0');
  for (const PickleNode& node : file.pickle.nodes)
    if (node.kind == PickleKind::kTensor) (void)tensor_values(file, node, "tensor");
}

std::string joblib_sample(unsigned /*seed*/) {
  test::PickleWriter out;
  out.raw("}(").text("x").joblib_doubles({2, 2}, {1, 2, 3, 4}).text("y").joblib_array({2}, "abcdefgh", "f4", true, 0);
  return out.raw("u.").str();
}
void read_joblib_bytes(std::string_view bytes) {
  const Pickle pickle = parse_joblib(bytes, "fuzz.pkl");
  for (const PickleNode& node : pickle.nodes)
    if (node.kind == PickleKind::kArray && node.built) (void)array_values(pickle, node, "array");
}

std::string object_npy_sample(unsigned /*seed*/) {
  std::string dictionary = "{'descr': '|O', 'fortran_order': False, 'shape': (), }";
  dictionary += std::string(63 - (10 + dictionary.size()) % 64, ' ') + "\n";
  test::PickleWriter out(3);
  out.call("numpy.core.multiarray", "_reconstruct").call("numpy", "ndarray").integer(0).raw("\x85").bytes("b");
  out.raw("\x87R(").integer(1).raw(")").dtype("O8", "|").raw("\x89](}").text("x").doubles({2}, {1, 2}).raw("setb.");
  return std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(dictionary.size()) + '\0' + dictionary + out.str();
}
void read_object_npy(std::string_view bytes) { (void)parse_object_npy(bytes, "fuzz.npy"); }

}  // namespace

std::vector<Reader> body_readers() {
  return {{"joblib", joblib_sample, read_joblib_bytes},
          {"torch_pickle", torch_pickle_sample, read_torch_pickle_bytes},
          {"object_npy", object_npy_sample, read_object_npy},
          {"body_model", body_model_sample, read_body_model},
          {"inter_x", inter_x_sample, read_inter_x_file},
          {"inter_x_h5", inter_x_h5_sample, read_inter_x_h5_file},
          {"hdf5", hdf5_sample, read_hdf5_file},
          {"interhuman_raw", interhuman_sample, read_interhuman_file},
          {"amass", amass_sample, read_amass_file},
          {"motion_x", motion_x_sample, read_motion_x_file},
          {"gvhmr", gvhmr_sample, read_gvhmr_file},
          {"wham", wham_sample, read_wham_file},
          {"four_d_humans", phalp_sample, read_phalp_file}};
}

}  // namespace duet::fuzz
