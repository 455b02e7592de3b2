// Files that the readers of people refuse: each with one sentence that names the file and the place.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_files.h"
#include "duet/people/formats/people_formats.h"
#include "tests/motion/people_files.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::f4_npy;
using test::PickleWriter;
using test::ScratchFolder;
using test::Standin;
using test::thrown_message;
using ::testing::AnyOf;
using ::testing::HasSubstr;

const std::string kNothing = "(nothing was thrown)";

PeopleOptions with_all() {
  PeopleOptions options;
  options.task = Task::kHug;
  options.rate_hz = 30.0;
  return options;
}

// The sentence for a stand-in whose files `edit` has changed.
std::string refusal(const Standin& standin, const std::function<void(Standin&)>& edit,
                    const PeopleOptions& options = with_all()) {
  Standin edited = standin;
  edit(edited);
  const ScratchFolder folder;
  for (const test::StandinFile& file : edited.files) write_file(folder / file.path, file.bytes);
  std::vector<std::string> paths;
  for (const std::string& path : edited.paths) paths.push_back(folder / path);
  return thrown_message<InputError>([&] {
    const PeopleFormat& format = find_people_format(paths, edited.format);
    for (const ClipPlace& place : format.find(paths, options)) (void)read_source_clip(format, place, options);
  });
}

std::string refusal(const Standin& standin, std::size_t file, const std::string& bytes) {
  return refusal(standin, [&](Standin& edited) { edited.files.at(file).bytes = bytes; });
}

// Which file of a stand-in holds people.
std::size_t people_file(const Standin& standin) {
  return standin.format == "hi4d" ? 1 : 0;  // after meta.npz
}

TEST(PeopleBadInput, TruncatedEmptyAndWrongBytesNameTheFile) {
  for (const Standin& standin : test::people_standins()) {
    const std::size_t at = people_file(standin);
    const std::string& good = standin.files[at].bytes;
    const std::string name = standin.files[at].path.substr(standin.files[at].path.rfind('/') + 1);
    for (const std::string& bytes :
         {std::string(), std::string("hello"), good.substr(0, good.size() / 2), good.substr(0, good.size() - 40),
          std::string(200, '\xff'), std::string("\x93NUMPY\x01\x00", 8), std::string("PK\x03\x04", 4)}) {
      const std::string message = refusal(standin, at, bytes);
      EXPECT_THAT(message, AnyOf(HasSubstr(name), HasSubstr("found none"))) << standin.name << " " << bytes.size();
    }
  }
}

// A header that promises more than the file holds takes no memory.
TEST(PeopleBadInput, HugeHeadersAreRefused) {
  const Standin standin = test::npy_pair_standin();
  for (const std::vector<std::size_t>& shape :
       std::vector<std::vector<std::size_t>>{{1'000'000'000, 24, 3}, {1'000'000, 24, 3}, {0, 24, 3}})
    EXPECT_SENTENCE(refusal(standin, 0, f4_npy(shape, {})));
}

TEST(PeopleBadInput, WrongTypesAndShapesAreRefused) {
  const Standin pair = test::npy_pair_standin();
  EXPECT_SENTENCE(refusal(pair, 0, test::npy_of("<U1", {8, 24, 3}, std::string(4 * 8 * 72, '\0'))));
  EXPECT_SENTENCE(refusal(pair, 0, test::npy_of("|O", {8, 24, 3}, "x")));
  EXPECT_SENTENCE(refusal(pair, 0, f4_npy({8, 24, 2}, std::vector<double>(8 * 48))));
  const Standin both = test::npy_standin();
  EXPECT_SENTENCE(refusal(both, 0, f4_npy({8, 3, 25, 3}, std::vector<double>(8 * 225))));
  EXPECT_SENTENCE(refusal(test::inter_x_standin(), 0, f4_npy({8, 24, 3}, std::vector<double>(8 * 72))));
  EXPECT_SENTENCE(refusal(test::interhuman_standin(), 0, f4_npy({8, 60}, std::vector<double>(480))));
}

TEST(PeopleBadInput, PeopleOfDifferentLengthAreRefused) {
  const auto shorter = [](const std::string& layout, int points) {
    const RawPeople people = test::standin_people(test::standin_clip(6, 60.0), joint_layout(layout), test::y_up());
    return f4_npy({6, static_cast<std::size_t>(points), 3}, people.joints[1].data());
  };
  EXPECT_SENTENCE(refusal(test::npy_pair_standin(), 1, shorter("smpl-24", 24)));
  EXPECT_SENTENCE(refusal(test::inter_x_standin(), 1, shorter("optitrack-64", 64)));
}

TEST(PeopleBadInput, TwoRatesAreRefused) {
  const RawPeople people = test::standin_people(test::standin_clip(8, 30.0), joint_layout("smpl-22"));
  EXPECT_SENTENCE(refusal(test::csv_pair_standin(), 1, test::csv_of(people, {1}, 60.0)));
}

TEST(PeopleBadInput, OneFrameIsRefused) {
  for (const Standin& standin : {test::harmony4d_standin(), test::hi4d_standin()})
    EXPECT_SENTENCE(refusal(standin, [&](Standin& edited) { edited.files.resize(people_file(edited) + 1); }));
}

TEST(PeopleBadInput, ValuesThatAreNotFiniteAreRefusedWithTheirPlace) {
  RawPeople people = test::standin_people(test::standin_clip(8, 60.0), joint_layout("smpl-24"), test::y_up());
  people.joints[0].at(3, kHead).setConstant(std::nan(""));
  EXPECT_SENTENCE(refusal(test::npy_pair_standin(), 0, f4_npy(people.joints[0])));
}

TEST(PeopleBadInput, MissingKeysAreNamed) {
  Npz npz;
  npz.set_number("rate_hz", 20.0);
  npz.set("joints", joint_layout("kinect-15").names);
  EXPECT_SENTENCE(refusal(test::kinect_standin(), 0, npz.bytes()));
  const std::string no_joints =
      test::object_npy([](PickleWriter& out) { out.raw("}(").text("betas").integer(1).raw("u"); });
  EXPECT_SENTENCE(refusal(test::core4d_standin(), 0, zip_bytes({{"arr_0.npy", no_joints}})));
  EXPECT_SENTENCE(refusal(test::core4d_standin(), 0, zip_bytes({{"arr_1.npy", no_joints}})));
  EXPECT_SENTENCE(refusal(test::chi3d_standin(), 0, "{\"smplx\": []}"));
  EXPECT_SENTENCE(refusal(test::hi4d_standin(), 1, zip_bytes({{"verts.npy", f4_npy({2, 3}, std::vector<double>(6))}})));
}

// A pickle may name a class; it is refused by that name, and nothing runs.
TEST(PeopleBadInput, PicklesThatNameAClassAreRefused) {
  const auto attack = [](PickleWriter& out) { out.call("os", "system").text("touch /tmp/duet-was-here").raw("\x85R"); };
  const std::string bytes = test::object_npy(attack);
  EXPECT_SENTENCE(refusal(test::harmony4d_standin(), 0, bytes));
  EXPECT_SENTENCE(refusal(test::core4d_standin(), 0, zip_bytes({{"arr_0.npy", bytes}})));
  PickleWriter order(4);
  order.call("os", "system").text("x").raw("\x85R.");
  EXPECT_SENTENCE(refusal(test::inter_x_standin(), 2, order.str()));
}

TEST(PeopleBadInput, ZipBombsAreRefused) {
  // Both headers of the entry promise 2 GiB; whether that is so is not found out.
  std::string bomb = zip_bytes({{"joints_3d.npy", std::string(100'000, '\0')}});
  for (const auto& [header, size] : {std::pair{std::string("PK\x01\x02"), 24}, {std::string("PK\x03\x04"), 22}}) {
    const std::size_t at = bomb.find(header);
    ASSERT_NE(at, std::string::npos);
    bomb.replace(at + static_cast<std::size_t>(size), 4, std::string("\x00\x00\x00\x80", 4));
  }
  EXPECT_SENTENCE(refusal(test::hi4d_standin(), 1, bomb));
}

// Names out of files are names of clips, never paths.
TEST(PeopleBadInput, NamesThatClimbOutOfTheFolderAreRefused) {
  EXPECT_SENTENCE(refusal(test::inter_x_standin(), 3, "../../etc/passwd\n"));
  EXPECT_EQ(id_of("/data/../..", 1), "..");
  EXPECT_EQ(id_of("a/b c/d;e", 2), "b_c-d_e");
}

TEST(PeopleBadInput, LinksOutOfAFolderAreNotFollowed) {
  const ScratchFolder folder, elsewhere;
  const Standin standin = test::inter_x_standin();
  for (const test::StandinFile& file : standin.files) write_file(elsewhere / file.path, file.bytes);
  std::filesystem::create_directories(folder / "data");
  std::filesystem::create_directory_symlink(elsewhere / "skeletons", folder / "data/skeletons");
  const std::vector<std::string> paths = {folder / "data"};
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)find_people_format(paths); }));
}

TEST(PeopleBadInput, FramesThatAreLeftOutAreNamed) {
  const auto without = [](Standin& edited) { edited.files.erase(edited.files.begin() + 3); };
  EXPECT_THAT(refusal(test::harmony4d_standin(), without), HasSubstr("after frame 3 expected the next one, found 5"));
  EXPECT_THAT(refusal(test::hi4d_standin(), without), HasSubstr("after frame 12 expected the next one, found 14"));
  EXPECT_THAT(refusal(test::harmony4d_standin(),
                      [](Standin& edited) {
                        edited.files[2].path = "train/03_grappling/001_grappling/processed_data/poses3d/last.npy";
                      }),
              HasSubstr("named by the number of the frame, found 'last.npy'"));
}

TEST(PeopleBadInput, PeopleOfHarmony4dAreTwoAndTheSame) {
  const std::vector<double> points(17 * 4, 0.0);
  const auto frame = [&](const std::vector<std::string>& names) {
    return test::object_npy([&](PickleWriter& out) {
      out.raw("}(");
      for (const std::string& name : names) out.text(name).doubles({17, 4}, points);
      out.raw("u");
    });
  };
  EXPECT_SENTENCE(refusal(test::harmony4d_standin(), 0, frame({"aria01"})));
  EXPECT_SENTENCE(refusal(test::harmony4d_standin(), 4, frame({"aria01", "aria03"})));
}

TEST(PeopleBadInput, APersonOfHarmony4dHas17JointsOfThreeOrFourNumbers) {
  const auto person = [](const std::vector<int>& shape) {
    std::size_t size = 1;
    for (const int side : shape) size *= static_cast<std::size_t>(side);
    return refusal(test::harmony4d_standin(), 0, test::object_npy([&](PickleWriter& out) {
                     out.raw("}(");
                     for (const char* name : {"aria01", "aria02"})
                       out.text(name).doubles(shape, std::vector<double>(size, 0.0));
                     out.raw("u");
                   }));
  };
  EXPECT_SENTENCE(person({18, 3}));
  EXPECT_SENTENCE(person({17, 2}));
  EXPECT_SENTENCE(person({17, 5}));
  EXPECT_SENTENCE(person({68}));
}

TEST(PeopleBadInput, Chi3dsListsAreJudged) {
  const Standin standin = test::chi3d_standin();
  EXPECT_SENTENCE(refusal(standin, 0, R"({"joints3d_25": [[[[0,0,0]]]]})"));
  EXPECT_SENTENCE(refusal(standin, 0, R"({"joints3d_25": [[[[0,0,0]]], []]})"));
  std::string text = standin.files[0].bytes;
  text.replace(text.find("[["), 2, "[[\"x\", ");
  EXPECT_SENTENCE(refusal(standin, 0, text));
}

TEST(PeopleBadInput, ObjectsThatAreNotRigidAreRefused) {
  EXPECT_SENTENCE(refusal(test::core4d_standin(), 2, test::npy_of("<f8", {8, 4, 4}, std::string(8 * 128, '\0'))));
}

TEST(PeopleBadInput, PositionsWithoutNamesNeedASkeleton) {
  PeopleOptions options = with_all();
  EXPECT_SENTENCE(refusal(
      test::npy_standin(), [](Standin&) {}, options));
  options.skeleton = "kinect-20";
  EXPECT_SENTENCE(refusal(
      test::npy_standin(), [](Standin&) {}, options));
}

TEST(PeopleBadInput, CsvIsJudgedByLineAndColumn) {
  const Standin standin = test::csv_pair_standin();
  const std::string good = standin.files[0].bytes;
  const auto edited = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return refusal(standin, 0, text);
  };
  EXPECT_SENTENCE(edited("head_x", "head_q"));
  EXPECT_SENTENCE(edited("head_x", "head_y"));
  EXPECT_SENTENCE(edited("0.00000,", "0.00000,zero"));
  EXPECT_SENTENCE(edited("0.03333,", "0.03333,1,"));
  EXPECT_SENTENCE(edited("0.06667,", "0.09667,"));
  EXPECT_SENTENCE(refusal(standin, 0, "time,wrist\n1,2\n"));
  EXPECT_SENTENCE(refusal(standin, 0, "# nothing\n"));
  EXPECT_SENTENCE(refusal(test::csv_standin(), [](Standin& both) {
    std::string& text = both.files[0].bytes;
    text.replace(text.find("b_nose_x"), 8, "b_chin_x");
  }));
}

InteractionClip seven_hertz() {
  InteractionClip clip = test::standin_clip(105, 50.0, Task::kWave);
  for (HumanMotion* person : {&clip.a, &clip.b}) *person = resample(*person, 7.0);
  return clip;
}

// Frames at 6 to 8 Hz, as a camera gives them.
std::string uneven_csv(double longest_step) {
  const RawPeople people = test::standin_people(seven_hertz(), joint_layout("kinect-20"));
  std::string text = test::csv_of(people, {0, 1}, 7.0);
  for (int t = 1; t < 15; ++t) {
    const std::string even = fmt::format("\n{:.5f},", t / 7.0);
    const double time = t / 7.0 + (t % 2 == 0 ? 0.0 : 0.02) + (t > 10 ? longest_step - 1.0 / 7.0 : 0.0);
    text.replace(text.find(even), even.size(), fmt::format("\n{:.5f},", time));
  }
  return text;
}

TEST(PeopleBadInput, UnevenTimesArePutInOrderWhereThatIsAskedFor) {
  const auto edit = [](const std::string& text) { return [text](Standin& standin) { standin.files[0].bytes = text; }; };
  const Standin standin = test::csv_standin();
  PeopleOptions options;
  options.task = Task::kWave;
  EXPECT_SENTENCE(refusal(standin, edit(uneven_csv(1.0 / 7.0)), options));
  options.fill_gaps = 0.25;
  EXPECT_EQ(refusal(standin, edit(uneven_csv(1.0 / 7.0)), options), kNothing);
  EXPECT_SENTENCE(refusal(standin, edit(uneven_csv(0.4)), options));
  options.fill_gaps = 10.0;
  EXPECT_SENTENCE(refusal(standin, edit(uneven_csv(9.0)), options));
}

TEST(PeopleBadInput, OnePersonAloneNeedsAPartner) {
  const Standin standin = test::csv_pair_standin();
  PeopleOptions options = with_all();
  const auto only_a = [](Standin& edited) { edited.files.pop_back(), edited.paths.pop_back(); };
  EXPECT_SENTENCE(refusal(standin, only_a, options));
  const auto one = [](Standin& edited) {
    edited.files[0].bytes = f4_npy({8, 25, 3}, std::vector<double>(8 * 75));
    edited.paths = {edited.files[0].path};
  };
  EXPECT_SENTENCE(refusal(test::npy_standin(), one, options));
  options.still_partner = true;
  EXPECT_EQ(refusal(standin, only_a, options), kNothing);
  EXPECT_EQ(refusal(
                standin, [](Standin&) {}, options),
            kNothing);  // each of the two alone
}

TEST(PeopleBadInput, WhatIsNoDataIsSaidByNameWhateverItsEnding) {
  const ScratchFolder folder;
  const std::string pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 1\n";
  for (const char* name : {"x.npz", "x.npy", "x.csv", "x.bvh", "x.pkl", "x.pt", "x.h5", "x.skeleton", "x.json"}) {
    for (const std::string& bytes : {pointer, std::string("<!DOCTYPE html><html>"),
                                     std::string("\xff\xfe"
                                                 "a\0_\0x\0,\0",
                                                 10),
                                     std::string()}) {
      write_file(folder / name, bytes);
      const std::vector<std::string> paths = {folder / name};
      EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)find_people_format(paths); }));
    }
  }
}

TEST(PeopleBadInput, APathWithoutPeopleIsSaidShortlyWithWhatItHolds) {
  const ScratchFolder folder;
  write_file(folder / "data/a.dat", "x");
  write_file(folder / "data/b.dat", "x");
  write_file(folder / "notes.md", "# Notes\nmore");
  const auto message = [&](const std::string& name) {
    const std::vector<std::string> paths = {folder / name};
    return thrown_message<InputError>([&] { (void)find_people_format(paths); });
  };
  EXPECT_SENTENCE(message("data"));
  EXPECT_SENTENCE(message("notes.md"));
  for (const char* name : {"data", "notes.md"}) EXPECT_LT(message(name).size(), 300U) << message(name);
}

TEST(PeopleBadInput, OptionsThatBvhFilesHaveNoUseForAreRefused) {
  const ScratchFolder folder;
  test::BvhWriter writer;
  write_file(folder / "a.bvh", writer.text());
  const std::vector<std::string> paths = {folder / "a.bvh", folder / "a.bvh"};
  PeopleOptions options;
  const PeopleFormat& format = find_people_format(paths);
  const ClipPlace place = format.find(paths, options).at(0);
  const auto message = [&] {
    return thrown_message<InputError>([&] { (void)read_source_clip(format, place, options); });
  };
  EXPECT_SENTENCE(message());
  options.task = Task::kHug;
  options.up = Axis::kMinusX;
  EXPECT_SENTENCE(message());
  options.up.reset();
  options.floor = 0.1;
  EXPECT_SENTENCE(message());
}

TEST(PeopleBadInput, ABrokenHdf5FileIsRefusedByName) {
  const ScratchFolder folder;
  write_file(folder / "test.h5", "\x89HDF\r\n\x1a\n and the rest");
  const std::vector<std::string> paths = {folder / "test.h5"};
  const PeopleFormat& format = find_people_format(paths, "");
  EXPECT_EQ(format.name, "inter-x-h5");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)format.find(paths, {}); }));
}

}  // namespace
}  // namespace duet
