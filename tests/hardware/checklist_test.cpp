// The form that somebody fills in before a robot is armed: what is missing, stale or of something else.
#include "duet/hardware/safety/checklist.h"

#include <gmock/gmock.h>

#include <string>

#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/log/log_reader.h"
#include "duet/hardware/log/run_report.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kNow = 1795860900.0;  // 2026-11-28T10:15Z [s]
const std::string kConfigDigest(64, 'a'), kCardDigest(64, 'b');

std::string with(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return text;
}

std::string filled() {
  std::string text = empty_checklist("E21-1", kConfigDigest, kCardDigest, kNow);
  text = with(text, "who: \"\"", "who: A. Name");
  const char* values[] = {"B. Name", "", "5", "12", "stood 0.1 s, then fell into the rope", "10", "", "41.5"};
  const std::vector<std::string> names = checklist_names();
  for (std::size_t k = 0; k < kChecklistItems; ++k) {
    const std::string value = values[k];
    text = with(text, names[k] + (value.empty() ? ": {done: no}" : ": {done: no, value: \"\"}"),
                names[k] + (value.empty() ? ": {done: yes}" : ": {done: yes, value: \"" + value + "\"}"));
  }
  return text;
}

std::string refusal_of(const std::string& text) {
  return test::thrown_message<InputError>([&] { (void)parse_checklist(text, "form.yaml"); });
}

TEST(Checklist, IsReadAsItWasFilledIn) {
  const Checklist form = parse_checklist(filled(), "form.yaml");
  EXPECT_EQ(form.robot, "E21-1");
  EXPECT_EQ(form.who, "A. Name");
  EXPECT_EQ(form.when, "2026-11-28T10:15Z");
  EXPECT_EQ(form.at, kNow);
  EXPECT_EQ(form.configuration, kConfigDigest);
  for (const ChecklistAnswer& answer : form.answers) EXPECT_TRUE(answer.done);
  EXPECT_EQ(form.answers[3].value, "12");
  EXPECT_EQ(checklist_json(form)["items"][7]["value"], "41.5");
  EXPECT_EQ(checklist_refusal(form, {"form.yaml"}, "E21-1", kConfigDigest, kCardDigest, kNow + 60.0), "");
}

TEST(Checklist, AnEmptyOneSaysWhatIsToBeFilledIn) {
  const std::string empty = empty_checklist("E21-1", kConfigDigest, kCardDigest, kNow);
  EXPECT_SENTENCE(refusal_of(empty));
  const Checklist form = parse_checklist(with(empty, "who: \"\"", "who: A. Name"), "form.yaml");
  EXPECT_SENTENCE(checklist_refusal(form, {"form.yaml"}, "E21-1", kConfigDigest, kCardDigest, kNow));
}

TEST(Checklist, NamesWhatIsWrong) {
  const std::string good = filled();
  for (const auto& [from, to] : std::initializer_list<std::pair<const char*, const char*>>{
           {"  feet: {done: yes}\n", ""},
           {"feet:", "foot:"},
           {"items:", "item:"},
           {"duet.checklist/1", "duet.checklist/2"},
           {"when: 2026-11-28T10:15Z", "when: 28.11.2026"},
           {"when: 2026-11-28T10:15Z", "when: 2026-02-30T10:15Z"},
           {"when: 2026-11-28T10:15Z", "when: 2026-11-28T24:15Z"},
           {"value: \"12\"", "value: \"9\""},
           {"value: \"12\"", "value: ten"},
           {"value: \"12\"", "value: nan"},
           {"{done: yes, value: \"12\"}", "{done: yes}"},
           {"{done: yes, value: \"12\"}", "{done: perhaps}"},
           {"{done: yes, value: \"12\"}", "yes"},
           {"twin: {done: yes}", "twin: {done: yes, value: 3}"},
           {"twin: {done: yes}", "twin: {done: no}"}})
    EXPECT_SENTENCE(refusal_of(with(good, from, to)));
}

TEST(Checklist, IsOneRobotsForOneConfigurationAndGrowsOld) {
  const Checklist form = parse_checklist(filled(), "form.yaml");
  const ChecklistDemand demand{"form.yaml", 12.0};
  const std::string other(64, 'c');
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-2", kConfigDigest, kCardDigest, kNow));
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", other, kCardDigest, kNow));
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, other, kNow));
  EXPECT_EQ(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow + 12 * 3600.0), "");
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow + 12.1 * 3600.0));
  EXPECT_EQ(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow - 300.0), "");
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow - 3600.0));
}

TEST(Checklist, WhatComesAfterTheLastItemThatIsAskedForMayBeOpen) {
  const std::string text =
      with(with(filled(), "feet: {done: yes}", "feet: {done: no}"), "dummy: {done: yes", "dummy: {done: no");
  const Checklist form = parse_checklist(text, "form.yaml");
  ChecklistDemand demand{"form.yaml"};
  EXPECT_SENTENCE(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow));
  demand.up_to = "stops";
  EXPECT_EQ(checklist_refusal(form, demand, "E21-1", kConfigDigest, kCardDigest, kNow), "");
}

TEST(Checklist, AConfigurationSaysWhetherItIsNeeded) {
  const auto config = [](const std::string& checklist) {
    return parse_robot_config(
               "schema: duet.robot/1\nrobot: twin\ntwin: true\ninterface: lo\ndomain: 150\n"
               "mode_machine: 5\nchecklist: " +
                   checklist + "\n",
               "twin.yaml")
        .checklist;
  };
  EXPECT_EQ(config("{form: a.yaml}").hours, 12.0);
  EXPECT_FALSE(config("{form: a.yaml}").required);
  const ChecklistDemand demand = config("{form: a.yaml, hours: 8, up_to: stops, required: true}");
  EXPECT_TRUE(demand.required && demand.hours == 8.0 && demand.up_to == "stops" && demand.form == "a.yaml");
  for (const char* text : {"{hours: 8}", "{form: a.yaml, hours: 0}", "{form: a.yaml, up_to: end}", "a.yaml"})
    EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)config(text); }));
}

TEST(Checklist, IsKeptWithTheLog) {
  const test::ScratchFolder folder;
  GuardSetup setup = test::twin_guard();
  setup.checklist = dumped(checklist_json(parse_checklist(filled(), "form.yaml")));
  {
    test::GuardedTwin robot(setup);
    RunLog log(folder / "run.mcap", setup);
    robot.tick();
    log.add(robot.guard);
  }
  const RunReport report = report_of_log(folder / "run.mcap");
  EXPECT_EQ(report.checked_by, "A. Name");
  EXPECT_EQ(report.checked_when, "2026-11-28T10:15Z");
  ASSERT_EQ(report.checks.size(), kChecklistItems);
  EXPECT_EQ(report.checks[5].name, "stops");
  EXPECT_EQ(report.checks[5].value, "10");
  EXPECT_TRUE(report.checks[5].done);
}

}  // namespace
}  // namespace duet
