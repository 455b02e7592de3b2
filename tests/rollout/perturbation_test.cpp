#include "duet/rollout/perturbations/perturbation.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <optional>

#include "duet/core/require.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

constexpr const char* kSuite =
    "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
    "controllers: [pd]\npolicies: [replay]\n";

std::vector<Perturbation> read(const std::string& list) {
  return parse_suite(kSuite + ("perturbations: " + list + "\n"), "p.yaml").perturbations;
}

std::string refusal(const std::string& list) {
  return test::thrown_message<InputError>([&] { read(list); });
}

TEST(Perturbation, ASuiteThatSaysNothingIsClean) {
  const Suite suite = parse_suite(kSuite, "p.yaml");
  ASSERT_EQ(suite.perturbations.size(), 1U);
  EXPECT_EQ(suite.perturbations[0].name, "clean");
  EXPECT_EQ(resolved_yaml(suite).find("perturbations"), std::string::npos);
}

TEST(Perturbation, NamesAloneHaveTheDocumentedDefaults) {
  const std::vector<Perturbation> list =
      read("[clean, delay, latency, noise, push, friction, mass, plan_latency, kick]");
  ASSERT_EQ(list.size(), 9U);
  EXPECT_EQ(list[0].name, "clean");
  EXPECT_EQ(list[1].delay_ticks, 2);
  EXPECT_EQ(list[2].latency_ms, 20.0);
  EXPECT_EQ(to_yaml(list[3]), "{name: noise, noise: {q: 0.01, v: 0.5, w: 0.2, gravity: 0.05}}");
  EXPECT_EQ(to_yaml(list[4]), "{name: push, push: {force: 60, duration: 1, every: 4}}");
  EXPECT_EQ(list[5].friction, 0.4);
  EXPECT_EQ(to_yaml(list[6]), "{name: mass, mass: {add: 3}}");
  EXPECT_EQ(list[6].name, "mass");
  EXPECT_EQ(list[7].plan_latency_ms, 100.0);
  EXPECT_EQ(to_yaml(list[8]), "{name: kick, kick: {speed: 0.5, first: 2, from: 3, to: 6}}");
}

TEST(Perturbation, ValuesAndCombinationsAreRead) {
  const std::vector<Perturbation> list = read(
      "[{name: push60, push: {force: 50, duration: 0.5, link: pelvis, every: 3}}, {delay: {ticks: 4}}, "
      "{noise: {q: 0.02}}, {friction: 0.3, mass: {add: -1.5}}]");
  EXPECT_EQ(list[0].name, "push60");
  EXPECT_THAT(to_yaml(list[0]), HasSubstr("{force: 50, duration: 0.5, every: 3, link: pelvis}"));
  EXPECT_EQ(list[1].name, "delay");
  EXPECT_THAT(to_yaml(list[2]), HasSubstr("{q: 0.02, v: 0, w: 0, gravity: 0}"));  // what is not named has none
  EXPECT_EQ(list[3].name, "friction+mass");
  EXPECT_THAT(to_yaml(list[3]), HasSubstr("mass: {add: -1.5}"));
}

TEST(Perturbation, ActuationNamesWhatDiffersFromTheProfile) {
  const std::vector<Perturbation> list = read("[actuation, {name: held, actuation: {law: explicit}}]");
  EXPECT_EQ(to_yaml(list[0]), "{name: actuation, actuation: {law: explicit, armature: 0, dt: 0.001}}");
  EXPECT_EQ(to_yaml(list[1]), "{name: held, actuation: {law: explicit}}");
  EXPECT_FALSE(list[1].actuation->armature || list[1].actuation->dt);
  EXPECT_EQ(tags_of(list[1]).at(std::string(kKindsTag)), "actuation");
  EXPECT_THAT(refusal("[{actuation: {law: implict}}]"), HasSubstr("'implicit'"));
  EXPECT_THAT(refusal("[{actuation: {armature: 1.5}}]"), HasSubstr("expected a number from 0, at most 1, found 1.5"));
  EXPECT_THAT(refusal("[{actuation: {dt: 0.003}}]"), HasSubstr("divides 0.02, found 0.003"));
}

TEST(Perturbation, WrittenOutItReadsBackToTheSame) {
  for (const char* text : {"clean", "push",
                           "{name: all, delay: {ticks: 3}, latency: {ms: 12.5}, noise: {w: 0.1}, "
                           "push: {force: 7}, friction: 1.2, mass: {link: pelvis, add: 2}, plan_latency: {ms: 60}}",
                           "{name: k, kick: {speed: 1, first: 0.5, from: 2, to: 2.5}}",
                           "{name: a, actuation: {law: explicit, armature: 0.5, dt: 0.0005}}"}) {
    const std::string once = to_yaml(read(std::string("[") + text + "]")[0]);
    EXPECT_EQ(to_yaml(read("[" + once + "]")[0]), once);
  }
}

TEST(Perturbation, WhatIsWrongIsNamedWithItsLine) {
  for (const char* text :
       {"[puhs]", "[{name: x}]", "[{name: clean, delay: {ticks: 1}}]", "[{name: 'a b', delay: {ticks: 1}}]",
        "[push, push]", "[]", "push", "[{push: {forec: 3}}]", "[{delay: {ticks: 1.5}}]", "[{delay: {ticks: 0}}]",
        "[{latency: {ms: 0}}]", "[{noise: {q: -1}}]", "[{push: {duration: 3, every: 2}}]", "[{kick: {from: 3, to: 2}}]",
        "[{kick: {speed: 0}}]", "[{friction: nan}]", "[{mass: 3}]"})
    EXPECT_SENTENCE(refusal(text));
}

// The text that a suite's hash is made of: no row of the table may change a letter of it.
TEST(Perturbation, EveryKindIsWrittenAsItAlwaysWas) {
  const std::vector<std::pair<std::string, std::string>> written = {
      {"delay", "{ticks: 2}"},
      {"latency", "{ms: 20}"},
      {"noise", "{q: 0.01, v: 0.5, w: 0.2, gravity: 0.05}"},
      {"push", "{force: 60, duration: 1, every: 4}"},
      {"kick", "{speed: 0.5, first: 2, from: 3, to: 6}"},
      {"friction", "0.4"},
      {"mass", "{add: 3}"},
      {"actuation", "{law: explicit, armature: 0, dt: 0.001}"},
      {"jitter", "{sigma: 0.02}"},
      {"dropout", "{p: 0.1}"},
      {"perception_latency", "{ms: 200}"},
      {"vanish", "{at: 2}"},
      {"freeze", "{at: 2, for: 1}"},
      {"jump", "{at: 2, metres: 0.3}"},
      {"plan_latency", "{ms: 100}"},
      {"partner", "{scale: 1, speed: 1, shift_s: 0, hesitate_s: 0, abort: false}"}};
  ASSERT_EQ(perturbation_kinds().size(), written.size());
  for (std::size_t i = 0; i < written.size(); ++i) {
    const auto& [kind, values] = written[i];
    EXPECT_EQ(perturbation_kinds()[i], kind);
    EXPECT_EQ(to_yaml(default_perturbation(kind)), "{name: " + kind + ", " + kind + ": " + values + "}");
    EXPECT_EQ(to_yaml(read("[{" + kind + ": " + values + "}]")[0]), to_yaml(default_perturbation(kind)));
  }
}

TEST(Perturbation, ADefaultRisesToTheValueThatBoundsIt) {
  EXPECT_THAT(to_yaml(read("[{push: {duration: 5}}]")[0]), HasSubstr("every: 5}"));
  EXPECT_THAT(to_yaml(read("[{kick: {from: 8}}]")[0]), HasSubstr("to: 8}"));
  EXPECT_THAT(to_yaml(read("[{kick: {from: 2}}]")[0]), HasSubstr("to: 6}"));
}

TEST(Perturbation, LinksAreThoseOfTheRobot) {
  const auto robot = test::g1();
  Perturbation perturbation = read("[{name: push, push: {link: torso_lnik}}]")[0];
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { check_perturbation(perturbation, *robot); }));
  perturbation = read("[{push: {link: base_to_torso}}]")[0];  // a link of another robot
  const std::string refusal =
      test::thrown_message<std::invalid_argument>([&] { check_perturbation(perturbation, *robot); });
  EXPECT_SENTENCE(refusal);
  EXPECT_LT(refusal.size(), 250U);  // not the names of all frames
  perturbation = read("[{mass: {add: -90}}]")[0];
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { check_perturbation(perturbation, *robot); }));
}

TEST(Perturbation, ALinkThatIsNotNamedIsTheCards) {
  const auto g1 = test::g1(), t1 = load_shared_robot("t1");
  EXPECT_EQ(g1->links[perturbed_link("", *g1)].name, "torso_link");
  EXPECT_EQ(t1->links[perturbed_link("", *t1)].name, "Trunk");
  EXPECT_EQ(t1->links[perturbed_link("chest_link", *t1)].name, "Trunk");
  EXPECT_EQ(g1->links[perturbed_link("rhand", *g1)].name, "right_wrist_yaw_link");  // a track of the card
  EXPECT_EQ(t1->links[perturbed_link("rhand", *t1)].name, "right_hand_link");
  EXPECT_THAT(to_yaml(with_links(default_perturbation("push"), *g1)), HasSubstr("link: torso_link"));
  EXPECT_THAT(to_yaml(with_links(default_perturbation("mass"), *t1)), HasSubstr("link: Trunk"));
  EXPECT_EQ(to_yaml(with_links(default_perturbation("mass"), *g1)), "{name: mass, mass: {link: torso_link, add: 3}}");
  EXPECT_NO_THROW(check_perturbation(default_perturbation("push"), *t1));
}

TEST(Perturbation, AddedMassIsOfItsLinkAlone) {
  const auto robot = test::g1();
  const auto heavier = perturbed_robot(default_perturbation("mass"), robot);
  EXPECT_NEAR(heavier->total_mass() - robot->total_mass(), 3.0, 1e-12);
  for (size_t i = 0; i < robot->links.size(); ++i)
    EXPECT_NEAR(heavier->links[i].mass - robot->links[i].mass, robot->links[i].name == "torso_link" ? 3.0 : 0.0, 1e-12);
  EXPECT_EQ(perturbed_robot(default_perturbation("push"), robot), robot);
}

std::string size_text(const std::string& item) {
  const std::optional<PerturbationSize> size = size_of(read("[" + item + "]").front());
  return size ? fmt::format("{} {} {} ({})", size->family, size->x, size->unit, size->beside) : "none";
}

// Its value is its size, whatever it is called.
TEST(PerturbationSize, IsItsOneValueThatACleanEpisodeLacks) {
  EXPECT_EQ(size_text("{name: push_60n, push: {force: 5}}"), "push 5 N (duration: 1, every: 4)");
  EXPECT_EQ(size_text("{name: jitter_9m, jitter: {sigma: 0.01}}"), "jitter 0.01 m ()");
  EXPECT_EQ(size_text("{name: a, dropout: {p: 0.2}}"), "dropout 0.2  ()");
  EXPECT_EQ(size_text("{name: a, perception_latency: {ms: 250}}"), "perception_latency 0.25 s ()");
  EXPECT_EQ(size_text("{name: a, latency: {ms: 20}}"), "latency 0.02 s ()");
  EXPECT_EQ(size_text("delay"), "delay 2 ticks ()");
  EXPECT_EQ(size_text("{name: a, kick: {speed: 0.5}}"), "kick 0.5 m/s (first: 2, from: 3, to: 6)");
  EXPECT_EQ(size_text("{name: a, mass: {add: -1.5}}"), "mass -1.5 kg ()");
  EXPECT_EQ(size_text("{name: a, freeze: {at: 4, for: 1}}"), "freeze 1 s (at: 4)");
  EXPECT_EQ(size_text("{name: a, partner: {shift_s: -0.5}}"), "partner.shift_s -0.5 s ()");
  EXPECT_EQ(size_text("{name: a, partner: {comes_m: 1}}"), "partner.comes_m 1 m ()");
  EXPECT_EQ(size_text("{name: a, noise: {q: 0.02}}"), "noise.q 0.02 rad ()");
}

TEST(PerturbationSize, SeveralKindsOrValuesAndThoseWithoutAZeroHaveNone) {
  for (const char* item :
       {"clean", "noise", "friction", "{name: push_60n, vanish: {at: 4}}",
        "{name: jitter_1cm, jitter: {sigma: 0.01}, dropout: {p: 0.1}}", "{name: a, partner: {scale: 0.9}}",
        "{name: a, partner: {shift_s: 1, scale: 0.9}}", "{name: a, partner: {shift_s: 1, comes_m: 1}}",
        "{name: a, partner: {hesitate_s: 1, other_hand: true}}", "{name: a, partner: {abort: true}}"})
    EXPECT_EQ(size_text(item), "none") << item;
}

TEST(PerturbationTags, AreItsOwnAndWhatItDoes) {
  const Perturbation push = read("[{name: a, tags: {level: 3, level_name: walks_up}, push: {force: 5}}]").front();
  EXPECT_THAT(tags_of(push),
              ::testing::ElementsAre(
                  ::testing::Pair("perturbation.beside", "duration: 1, every: 4"),
                  ::testing::Pair("perturbation.family", "push"), ::testing::Pair("perturbation.kinds", "push"),
                  ::testing::Pair("perturbation.level", "3"), ::testing::Pair("perturbation.level_name", "walks_up"),
                  ::testing::Pair("perturbation.size", "5"), ::testing::Pair("perturbation.unit", "N")));
  EXPECT_TRUE(tags_of(Perturbation{}).empty());
  EXPECT_EQ(to_yaml(push),
            "{name: a, push: {force: 5, duration: 1, every: 4}, tags: {level: 3, level_name: walks_up}}");
  EXPECT_EQ(to_yaml(read("[" + to_yaml(push) + "]").front()), to_yaml(push));
}

TEST(PerturbationTags, AreRefusedWhereNoTableCanReadThem) {
  const auto tagged = [](const std::string& tags) {
    return refusal("[{name: a, push: {force: 5}, tags: " + tags + "}]");
  };
  for (const char* text :
       {"[level]", "{size: 60}", "{level: high}", "{level: -1}", "{level: 1234567}", "{\"a b\": 1}", "{a: [1]}"})
    EXPECT_SENTENCE(tagged(text));
}

}  // namespace
}  // namespace duet
