#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numeric>

#include "duet/archives/pickle/pickle_fields.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/archives/pickle_bytes.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::PickleWriter;
using test::thrown_message;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr int kFrames = 3;

// One entry of the dict, replaceable in the tests.
using Entry = std::function<void(PickleWriter&)>;

struct Entries {
  Entry fps = [](PickleWriter& out) { out.real(30.5); };
  Entry root_pos = [](PickleWriter& out) { out.doubles({3, 3}, {0, 1, 2, 3, 4, 5, 6, 7, 8}); };
  Entry root_rot = [](PickleWriter& out) { out.doubles({3, 4}, {0, 0, 0, 1, 0, 0, 0.6, 0.8, 1, 0, 0, 0}); };
  Entry dof_pos = [](PickleWriter& out) { out.doubles({3, 2}, {0.1, 0.2, 0.3, 0.4, 0.5, 0.6}); };
  Entry local_body_pos = [](PickleWriter& out) { out.none(); };
  Entry link_body_list = [](PickleWriter& out) { out.raw("](").text("pelvis").text("torso").raw("e"); };
  Entry more = [](PickleWriter&) {};
};

std::string pickle(const Entries& entries, int protocol = 4) {
  PickleWriter out(protocol);
  out.raw("}(");
  const auto put = [&](const std::string& key, const Entry& entry) {
    out.text(key);
    entry(out);
  };
  put("fps", entries.fps);
  put("root_pos", entries.root_pos);
  put("root_rot", entries.root_rot);
  put("dof_pos", entries.dof_pos);
  put("local_body_pos", entries.local_body_pos);
  put("link_body_list", entries.link_body_list);
  entries.more(out);
  return out.raw("u.").str();
}

std::string refusal(const std::string& bytes) {
  return thrown_message<InputError>([&] { (void)parse_motion_pickle(bytes, "x.pkl"); });
}

TEST(Pickle, ReadsTheSameFromEveryProtocol) {
  for (const int protocol : {2, 3, 4, 5}) {
    const PickledMotion read = parse_motion_pickle(pickle({}, protocol), "x.pkl");
    const RobotMotion& motion = read.motion;
    EXPECT_EQ(motion.rate_hz, 30.5);
    ASSERT_EQ(motion.frames(), kFrames);
    EXPECT_EQ(motion.root[2].p, Eigen::Vector3d(6, 7, 8));
    EXPECT_TRUE(motion.root[1].R.isApprox(Eigen::Quaterniond(0.8, 0, 0, 0.6), 1e-15));  // w, x, y, z
    EXPECT_EQ(motion.q.rows(), 2);
    EXPECT_EQ(motion.q(1, 2), 0.6);
    EXPECT_TRUE(motion.joint_names.empty());
    EXPECT_TRUE(read.local_body_pos.empty());
    EXPECT_EQ(read.link_body_list, (std::vector<std::string>{"pelvis", "torso"}));
    EXPECT_THAT(read.verdict, Contains(HasSubstr("rate: 30.5 Hz, 3 frames")));
    EXPECT_THAT(read.verdict, Contains(HasSubstr("read as xyzw; unit length")));
  }
}

TEST(Pickle, ReadsTypesByteOrdersAndMemoryOrders) {
  const std::vector<double> rows = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  const std::vector<double> columns = {0.1, 0.3, 0.5, 0.2, 0.4, 0.6};
  const std::vector<float> singles(rows.begin(), rows.end());
  const std::string packed_singles(reinterpret_cast<const char*>(singles.data()), 4 * singles.size());
  const std::vector<Entry> same = {
      [&](PickleWriter& out) {
        out.array({3, 2}, PickleWriter::packed(rows));
      },
      [&](PickleWriter& out) {
        out.array({3, 2}, PickleWriter::packed(rows, true), "f8", ">");
      },
      [&](PickleWriter& out) {
        out.array({3, 2}, PickleWriter::packed(columns), "f8", "<", true);
      },
      [&](PickleWriter& out) {
        out.array({3, 2}, packed_singles, "f4");
      },
      [&](PickleWriter& out) {  // protocol 5
        const std::string values = PickleWriter::packed(columns);
        out.call("numpy._core.numeric", "_frombuffer").raw("(\x96").little(values.size(), 8).raw(values);
        out.dtype("f8").integer(3).integer(2).raw("\x86").text("F").raw("tR");
      }};
  for (const Entry& dof_pos : same) {
    const RobotMotion motion = parse_motion_pickle(pickle({.dof_pos = dof_pos}), "x.pkl").motion;
    for (int t = 0; t < kFrames; ++t)
      for (int j = 0; j < 2; ++j) EXPECT_NEAR(motion.q(j, t), rows[2 * t + j], 1e-7);
  }
}

// Lists of numbers, of lists, of tuples and of arrays; in half precision; of a few bytes that would be many numbers.
TEST(Pickle, ReadsListsAndHalfPrecision) {
  const std::string halves("\x00\x3c\x00\x40\x00\x42\x00\x44\x00\x45\x00\x46", 12);
  const std::vector<Entry> same = {[](PickleWriter& out) {
                                     out.raw("](");
                                     for (const int t : {1, 3, 5}) out.raw("](").real(t).integer(t + 1).raw("e");
                                     out.raw("e");
                                   },
                                   [](PickleWriter& out) {
                                     out.raw("(");
                                     for (const int t : {1, 3, 5}) out.doubles({2}, {t + 0.0, t + 1.0});
                                     out.raw("t");
                                   },
                                   [&](PickleWriter& out) {
                                     out.array({3, 2}, halves, "f2");
                                   }};
  for (const Entry& dof_pos : same) {
    const RobotMotion motion = parse_motion_pickle(pickle({.dof_pos = dof_pos}), "x.pkl").motion;
    for (int t = 0; t < kFrames; ++t)
      for (int j = 0; j < 2; ++j) EXPECT_EQ(motion.q(j, t), 2 * t + j + 1);
  }
  const auto nested = [](int deep) {
    return [deep](PickleWriter& out) {
      std::string lists =
          "](K\x01"
          "eq\x01";
      for (int d = 1; d <= deep; ++d) {
        lists = "](" + lists;
        for (int i = 0; i < 200; ++i) lists += std::string("h") + static_cast<char>(d);
        lists += std::string("eq") + static_cast<char>(d + 1);
      }
      out.raw(lists);
    };
  };
  EXPECT_THAT(refusal(pickle({.dof_pos = nested(5)})), HasSubstr("expected lists of at most 4194304 numbers"));
  EXPECT_THAT(refusal(pickle({.dof_pos = nested(9)})), HasSubstr("expected lists at most 8 deep"));
}

TEST(Pickle, RateMayBeANumberOrANumPyScalar) {
  const std::vector<Entry> same = {
      [](PickleWriter& out) { out.integer(30); },
      [](PickleWriter& out) { out.real(30.0); },
      [](PickleWriter& out) { out.raw("\x8a\x01\x1e"); },
      [](PickleWriter& out) {
        out.call("numpy.core.multiarray", "scalar").dtype("f8").bytes(PickleWriter::packed({30.0})).raw("\x86R");
      },
      [](PickleWriter& out) { out.doubles({1}, {30.0}); },
      [](PickleWriter& out) {
        out.doubles({1, 1}, {30.0});
      },
      [](PickleWriter& out) { out.raw("](").integer(30).raw("e"); },
      [](PickleWriter& out) { out.text("30"); },
      [](PickleWriter& out) {
        out.call("numpy.core.multiarray", "scalar").dtype("u1", "|").bytes("\x1e").raw("\x86R");
      }};
  for (const Entry& fps : same) EXPECT_EQ(parse_motion_pickle(pickle({.fps = fps}), "x.pkl").motion.rate_hz, 30.0);
}

TEST(Pickle, NearlyUnitQuaternionsAreRenormalisedAndReported) {
  const PickledMotion read =
      parse_motion_pickle(pickle({.root_rot =
                                      [](PickleWriter& out) {
                                        out.doubles({3, 4}, {0, 0, 0, 1, 0, 0, 0, 0.95, 0, 0, 0, 1.02});
                                      }}),
                          "x.pkl");
  for (const Pose& X_WB : read.motion.root) EXPECT_NEAR(X_WB.R.norm(), 1.0, 1e-15);
  EXPECT_THAT(read.verdict, Contains(HasSubstr("renormalised, worst length off by 0.0500 in frame 1")));
  const PickledMotion tied =
      parse_motion_pickle(pickle({.root_rot =
                                      [](PickleWriter& out) {
                                        out.doubles({3, 4}, {0, 0, 0, 1, 0, 0, 0, 0.95, 0, 0, 0.95, 0});
                                      }}),
                          "x.pkl");
  EXPECT_THAT(tied.verdict, Contains(HasSubstr("off by 0.0500 in frame 1")));  // the first of those
}

TEST(Pickle, BodiesAreReadInTheirOrder) {
  std::vector<double> values(18);
  std::iota(values.begin(), values.end(), 0.0);
  const PickledMotion read = parse_motion_pickle(pickle({.local_body_pos =
                                                             [&](PickleWriter& out) {
                                                               out.doubles({3, 2, 3}, values);
                                                             }}),
                                                 "x.pkl");
  EXPECT_EQ(read.local_body_pos.points(), 2);
  EXPECT_EQ(Eigen::Vector3d(read.local_body_pos.at(2, 1)), Eigen::Vector3d(15, 16, 17));
}

// ---- what a hostile file may try
// -------------------------------------------------------------------------------------

TEST(Pickle, ForeignClassesAreRefusedByName) {
  const std::vector<Entry> attacks = {
      [](PickleWriter& out) { out.raw("cos\nsystem\n").text("id").raw("\x85R"); },
      [](PickleWriter& out) { out.text("os").text("system").raw("\x93").text("id").raw("\x85R"); },
      [](PickleWriter& out) { out.raw("cos\nsystem\n"); }};
  for (const Entry& attack : attacks)
    for (const int protocol : {2, 4}) {
      const std::string message = refusal(pickle({.more =
                                                      [&](PickleWriter& out) {
                                                        out.text("x");
                                                        attack(out);
                                                      }},
                                                 protocol));
      EXPECT_THAT(message, HasSubstr("x.pkl': byte "));
      EXPECT_THAT(message, HasSubstr("'os.system' is refused"));
    }
}

TEST(Pickle, OnlyNumPysOwnNamesAreKnown) {
  for (const auto& [module, name] : {std::pair<std::string, std::string>{"builtins", "eval"},
                                     {"numpy", "load"},
                                     {"numpy.core.multiarray", "fromfile"},
                                     {"numpy", "_reconstruct"},
                                     {"_codecs", "decode"},
                                     {"collections", "OrderedDict"},
                                     {"joblib.numpy_pickle", "NumpyArrayWrapper"}})
    EXPECT_THAT(refusal(PickleWriter().call(module, name).raw(".").str()),
                HasSubstr("'" + module + "." + name + "' is refused"));
}

TEST(Pickle, OpcodesThatMakeObjectsAreRefusedByName) {
  for (const auto& [code, name] : {std::pair<std::string, std::string>{"\x81", "NEWOBJ"},
                                   {"\x92", "NEWOBJ_EX"},
                                   {"ios\nsystem\n", "INST"},
                                   {"o", "OBJ"},
                                   {"P1\n", "PERSID"},
                                   {"Q", "BINPERSID"},
                                   {"\x82\x01", "EXT1"},
                                   {"\x97", "NEXT_BUFFER"}})
    EXPECT_THAT(refusal(PickleWriter().raw(code).str()), HasSubstr("byte 2: opcode " + name + " is refused"));
  EXPECT_THAT(refusal(PickleWriter().raw("\xff").str()),
              HasSubstr("byte 2: expected an opcode of a dict of NumPy arrays, found 0xff"));
}

TEST(Pickle, TruncatedAnywhereIsRefused) {
  for (const int protocol : {2, 4}) {
    const std::string good = pickle({}, protocol);
    for (std::size_t size = 0; size < good.size(); ++size)
      EXPECT_THAT(refusal(good.substr(0, size)), HasSubstr("x.pkl")) << size;
  }
  EXPECT_THAT(refusal(""), HasSubstr("the file is empty"));
}

// Each of these was made to be refused by one check; the message tells which.
TEST(Pickle, BrokenMachineCodeIsRefused) {
  const auto code = [](const std::string& raw) { return refusal(PickleWriter().raw(raw).str()); };
  using namespace std::string_literals;
  EXPECT_THAT(refusal("hello"), HasSubstr("byte 0: expected a pickle of protocol 2 to 5"));
  EXPECT_THAT(refusal("\x80\x01."), HasSubstr("expected pickle protocol 2 to 5, found 1"));
  EXPECT_THAT(refusal("\x80\x06."), HasSubstr("expected pickle protocol 2 to 5, found 6"));
  EXPECT_THAT(code("."), HasSubstr("expected one value at STOP"));
  EXPECT_THAT(code("NN."), HasSubstr("expected one value at STOP"));
  EXPECT_THAT(code("(N."), HasSubstr("expected one value at STOP"));
  EXPECT_THAT(code("N.N"), HasSubstr("expected the end of the file after STOP, found 1 more bytes"));
  EXPECT_THAT(code("N."), HasSubstr("expected a dict, found None"));
  EXPECT_THAT(code("a"), HasSubstr("expected a value on the stack, found none"));
  EXPECT_THAT(code("N(a"), HasSubstr("expected a value on the stack, found none"));
  EXPECT_THAT(code("NNa"), HasSubstr("expected a list, found None"));
  EXPECT_THAT(code("t"), HasSubstr("expected a MARK on the stack, found none"));
  EXPECT_THAT(code("}(Nu."), HasSubstr("expected keys and values in pairs"));
  EXPECT_THAT(code("}(NNu."), HasSubstr("expected a string as key, found None"));
  EXPECT_THAT(code("h\x07"), HasSubstr("memo 7 was never stored"));
  EXPECT_THAT(code("N(q\x01"), HasSubstr("expected a value on the stack, found none"));
  EXPECT_THAT(code("NNR"), HasSubstr("arguments of a call: expected a tuple, found None"));
  EXPECT_THAT(code("N)R"), HasSubstr("what is called: expected a class or function, found None"));
  EXPECT_THAT(code("N)b"), HasSubstr("expected an array or a dtype to build, found None"));
  EXPECT_THAT(code("\x8a\x09"), HasSubstr("expected an integer of at most 8 bytes, found 9"));
  EXPECT_THAT(code("X\xff\xff\xff\xff"), HasSubstr("the file is truncated: expected 4294967295 more bytes"));
  EXPECT_THAT(code("\x8e\xff\xff\xff\xff\xff\xff\xff\xff"s), HasSubstr("the file is truncated"));
  EXPECT_THAT(code("\x95\xff\0\0\0\0\0\0\0N."s), HasSubstr("the file is truncated: a frame of 255 bytes"));
  EXPECT_THAT(code(std::string(1'100'000, 'N')), HasSubstr("more than 1000000 objects"));
}

TEST(Pickle, BrokenArraysAreRefused) {
  const auto with = [](const Entry& dof_pos) { return refusal(pickle({.dof_pos = dof_pos})); };
  const std::string six = PickleWriter::packed({1, 2, 3, 4, 5, 6});
  EXPECT_THAT(with([&](PickleWriter& out) {
                out.array({3, 2}, six.substr(1));
              }),
              HasSubstr("key 'dof_pos': the shape (3, 2) takes 6 numbers of 8 bytes, found 47 bytes"));
  EXPECT_THAT(with([&](PickleWriter& out) {
                out.array({3, 1 << 30, 1 << 30, 1 << 30}, six);
              }),
              HasSubstr("key 'dof_pos': the shape"));
  EXPECT_THAT(with([&](PickleWriter& out) { out.array({3, -2}, six); }), HasSubstr("size -2 is out of range"));
  EXPECT_THAT(with([&](PickleWriter& out) {
                out.array({3, 2}, six, "O");
              }),
              HasSubstr("expected numbers of type f2, f4, f8, i1..i8 or u1..u8, found 'O'"));
  EXPECT_THAT(with([&](PickleWriter& out) {
                out.array({3, 2}, six, "f8", "=");
              }),
              HasSubstr("byte order: expected '<', '>' or '|', found '='"));
  EXPECT_THAT(with([](PickleWriter& out) { out.raw("](").real(1).real(2).raw("e"); }),
              HasSubstr("key 'dof_pos': expected shape (3, n), found (2)"));
  EXPECT_THAT(with([](PickleWriter& out) { out.raw("](](").real(1).real(2).raw("e](").real(3).raw("ee"); }),
              HasSubstr("key 'dof_pos': expected rows of one shape, found (2) in row 0 and (1) in row 1"));
  EXPECT_THAT(with([](PickleWriter& out) { out.raw("](").real(1).text("two").raw("e"); }),
              HasSubstr("key 'dof_pos': expected a NumPy array, found a string"));
  EXPECT_THAT(with([](PickleWriter& out) {
                out.call("numpy.core.multiarray", "_reconstruct").call("numpy", "ndarray").integer(0).raw("\x85");
                out.bytes("b").raw("\x87R");
              }),
              HasSubstr("key 'dof_pos': the array has no state"));
  EXPECT_THAT(with([](PickleWriter& out) { out.call("numpy", "ndarray").integer(0).raw("\x85R"); }),
              HasSubstr("a direct call of numpy.ndarray is refused"));
  EXPECT_THAT(with([](PickleWriter& out) {
                out.call("numpy.core.multiarray", "_reconstruct").call("numpy", "dtype").integer(0).raw("\x85");
                out.bytes("b").raw("\x87R");
              }),
              HasSubstr("type of an array: expected numpy.ndarray"));
}

// ---- motions that are well-formed pickles but no motions
// --------------------------------------------------------------

TEST(Pickle, MotionsThatDoNotFitAreRefused) {
  const auto rotations = [](std::vector<double> values) {
    return Entries{.root_rot = [=](PickleWriter& out) { out.doubles({3, 4}, values); }};
  };
  const double nan = std::nan("");
  EXPECT_THAT(refusal(pickle({.root_rot =
                                  [](PickleWriter& out) {
                                    out.doubles({2, 4}, {0, 0, 0, 1, 0, 0, 0, 1});
                                  }})),
              HasSubstr("key 'root_rot': expected shape (3, 4), found (2, 4)"));
  EXPECT_THAT(refusal(pickle({.root_pos =
                                  [](PickleWriter& out) {
                                    out.doubles({3, 2}, {1, 2, 3, 4, 5, 6});
                                  }})),
              HasSubstr("key 'root_pos': expected shape (T, 3), found (3, 2)"));
  EXPECT_THAT(refusal(pickle({.dof_pos =
                                  [](PickleWriter& out) {
                                    out.doubles({6}, {1, 2, 3, 4, 5, 6});
                                  }})),
              HasSubstr("key 'dof_pos': expected shape (3, n), found (6)"));
  EXPECT_THAT(refusal(pickle({.root_pos =
                                  [](PickleWriter& out) {
                                    out.doubles({1, 3}, {1, 2, 3});
                                  }})),
              HasSubstr("key 'root_pos': expected at least 2 frames, found 1"));
  EXPECT_THAT(refusal(pickle({.local_body_pos =
                                  [](PickleWriter& out) {
                                    out.doubles({3, 1, 3}, std::vector<double>(9));
                                  }})),
              HasSubstr("key 'local_body_pos': expected shape (3, 2, 3), found (3, 1, 3)"));
  EXPECT_THAT(refusal(pickle({.dof_pos =
                                  [=](PickleWriter& out) {
                                    out.doubles({3, 2}, {1, 2, 3, nan, 5, 6});
                                  }})),
              HasSubstr("key 'dof_pos': frame 1, number 1 is not finite"));
  EXPECT_THAT(refusal(pickle(rotations({0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1}))),
              HasSubstr("key 'root_rot': frame 1: expected a unit quaternion (xyzw), found length 0"));
  EXPECT_THAT(refusal(pickle(rotations({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1.2}))), HasSubstr("found length 1.2"));
  EXPECT_THAT(refusal(pickle({.fps = [](PickleWriter& out) { out.real(0.0); }})),
              HasSubstr("key 'fps': expected a positive rate, found 0"));
  EXPECT_THAT(refusal(pickle({.fps = [=](PickleWriter& out) { out.real(nan); }})), HasSubstr("key 'fps'"));
  EXPECT_THAT(refusal(pickle({.fps = [](PickleWriter& out) { out.text("thirty"); }})),
              HasSubstr("key 'fps': expected a number, found 'thirty'"));
  EXPECT_THAT(refusal(pickle({.fps = [](PickleWriter& out) { out.none(); }})), HasSubstr("missing key 'fps'"));
  EXPECT_THAT(refusal(pickle({.link_body_list = [](PickleWriter& out) { out.raw("](").integer(1).raw("e"); }})),
              HasSubstr("key 'link_body_list': expected a string, found an integer"));
}

TEST(Pickle, KeysAreChecked) {
  const auto with_more = [](PickleWriter& out) { out.text("robot_type").text("unitree_g1").text("height").real(1.7); };
  EXPECT_THAT(parse_motion_pickle(pickle({.more = with_more}), "x.pkl").verdict,
              Contains("left out: keys that are none of the format's: height, robot_type"));
  const auto with_names = [](PickleWriter& out) { out.text("dof_names").raw("](").text("a").text("b").raw("e"); };
  EXPECT_EQ(parse_motion_pickle(pickle({.more = with_names}), "x.pkl").motion.joint_names,
            (std::vector<std::string>{"a", "b"}));
  EXPECT_THAT(refusal(pickle({.more = [](PickleWriter& out) { out.text("fps").real(1.0); }})),
              HasSubstr("key 'fps' is there twice"));
  EXPECT_THAT(refusal(PickleWriter().raw("}(").text("fps").real(30.0).raw("u.").str()),
              HasSubstr("x.pkl': missing key 'root_pos'; keys found: fps"));
  EXPECT_THAT(refusal(pickle({.root_rot = [](PickleWriter& out) { out.none(); }})),
              HasSubstr("missing key 'root_rot'"));
}

// ---- real files
// --------------------------------------------------------------------------------------------------------

TEST(Pickle, ReadsRealMotions) {
  struct Known {
    std::string file;
    double rate_hz;
    int frames;
    int joints;
  };
  for (const Known& known :
       {Known{"twist2/walk_001.pkl", 29.87626854359289, 416, 29},
        Known{"twist2/walk_003.pkl", 29.876635954452137, 490, 29},
        Known{"twist2/walk_008.pkl", 29.850459348604527, 218, 29}, Known{"gmt/squat.pkl", 59.9999885559082, 304, 23},
        Known{"gmt/dance_waltz.pkl", 33.25062034739454, 269, 23},
        Known{"gmt/basic_walk.pkl", 29.980814325303772, 1173, 23}}) {
    const std::string path = test::shared_file("data/g1_motions/" + known.file);
    if (path.empty()) GTEST_SKIP() << "not run: data/g1_motions/" << known.file << " absent";
    const PickledMotion read = read_motion_pickle(path);
    EXPECT_EQ(read.motion.rate_hz, known.rate_hz);
    EXPECT_EQ(read.motion.frames(), known.frames);
    EXPECT_EQ(read.motion.q.rows(), known.joints);
    EXPECT_EQ(read.local_body_pos.points(), 38);
    EXPECT_EQ(read.link_body_list.front(), "pelvis");
    // Walking and squatting upright: the pelvis' z axis stays within 60 degrees of vertical, at the height of a G1.
    for (const Pose& X_WB : read.motion.root) {
      ASSERT_GT((X_WB.R * Eigen::Vector3d::UnitZ()).z(), 0.5) << known.file;
      ASSERT_GT(X_WB.p.z(), 0.2);
      ASSERT_LT(X_WB.p.z(), 1.0);
    }
  }
}

TEST(Pickle, ReportsTheQuaternionsOfBasicWalk) {
  const std::string path = test::shared_file("data/g1_motions/gmt/basic_walk.pkl");
  if (path.empty()) GTEST_SKIP() << "not run: data/g1_motions/gmt/basic_walk.pkl absent";
  EXPECT_THAT(read_motion_pickle(path).verdict, Contains(HasSubstr("renormalised, worst length off by 0.0257")));
}

}  // namespace
}  // namespace duet
