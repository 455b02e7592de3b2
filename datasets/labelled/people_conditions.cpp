#include "duet/datasets/labelled/people_conditions.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <tuple>

#include "duet/core/require.h"
#include "duet/metrics/interaction.h"
#include "duet/report/tables/text_table.h"
#include "duet/statistics/statistics.h"

namespace duet {
namespace {

constexpr double kStill = 0.05;  // a hand that keeps so near to its mean place does not move [m]

// Those that the rule judges without physics.
constexpr std::array<const char*, 5> kConditions = {"act", "alone", "touch", "body", "reply"};

bool stands_still(const Agent& agent) {
  const auto rests = [](const Eigen::Matrix3Xd& track) {
    return (track.colwise() - track.rowwise().mean()).colwise().norm().maxCoeff() < kStill;
  };
  return rests(agent.lhand) && rests(agent.rhand) && rests(agent.head);
}

PersonCheck verdict_of(const std::string& clip, const std::string& label, char person, const Agent& performer,
                       const Agent& partner) {
  PersonCheck verdict{.clip = clip, .label = label, .person = person, .by_task = {}};
  const InteractionEvidence evidence{
      .performer = performer, .partner = partner, .window = {0, static_cast<int>(performer.root.cols())}};
  for (const Task task : all_tasks())
    if (cannot_judge(task, evidence).empty()) verdict.by_task[task] = judge_interaction(task, evidence);
  return verdict;
}

// k of n.
struct Share {
  long k = 0, n = 0;

  void add(bool holds) {
    k += holds ? 1 : 0;
    ++n;
  }
  [[nodiscard]] double value() const { return static_cast<double>(k) / static_cast<double>(n); }
};

struct TaskShares {
  std::map<std::string, Share> conditions;
  Share all, refused;
};

TaskShares shares_of(const PeopleVerdicts& verdicts, Task task) {
  TaskShares shares;
  for (const PersonCheck& person : verdicts.people) {
    const auto found = person.by_task.find(task);
    if (found == person.by_task.end()) continue;
    const DetectorResult& result = found->second;
    if (person.label != to_string(task)) {
      shares.refused.add(!result.success);
      continue;
    }
    for (const char* condition : kConditions) shares.conditions[condition].add(result.parts.at(condition));
    shares.all.add(result.success);
  }
  return shares;
}

std::string share_cell(const Share& share) {
  if (share.n == 0) return "-";
  return fmt::format("{}/{} {}", share.k, share.n, percent(share.value(), wilson(share.k, share.n)));
}

nlohmann::json share_json(const Share& share) {
  if (share.n == 0) return nullptr;
  const Interval interval = wilson(share.k, share.n);
  return {{"hits", share.k}, {"of", share.n}, {"share", share.value()}, {"low", interval.low}, {"high", interval.high}};
}

std::string measured(const DetectorResult& result) {
  std::string text;
  for (const auto& [name, value] : result.values)
    text += fmt::format("{}{} {:.3g}", text.empty() ? "" : ", ", name, value);
  return text;
}

std::string failed_parts(const DetectorResult& result) {
  std::string text;
  for (const auto& [part, holds] : result.parts)
    if (!holds) text += (text.empty() ? "" : ", ") + part;
  return text;
}

}  // namespace

PeopleVerdicts judge_people(const LabelledClips& clips, const std::function<void(int done, int of)>& finished) {
  const std::vector<LabelledSource> sources = labelled_sources(clips);
  struct Judged {
    std::string message;
    std::vector<PersonCheck> people;
    long still = 0;
  };
  std::vector<Judged> judged(sources.size());
  const auto take = [&](int i, const LabelledPeople& people) {
    Judged& into = judged[i];
    into.message = people.message;
    if (!people.message.empty()) return;
    for (const auto& [person, own, other] : {std::tuple{'A', &people.a, &people.b}, {'B', &people.b, &people.a}}) {
      if (stands_still(*own))
        ++into.still;
      else
        into.people.push_back(verdict_of(sources[i].clip, people.label, person, *own, *other));
    }
  };
  for_each_labelled(sources, clips, take, finished);
  PeopleVerdicts verdicts;
  for (std::size_t i = 0; i < judged.size(); ++i) {
    if (!judged[i].message.empty()) verdicts.unread[sources[i].clip] = judged[i].message;
    verdicts.still += judged[i].still;
    std::ranges::move(judged[i].people, std::back_inserter(verdicts.people));
  }
  return verdicts;
}

TextTable people_conditions_table(const PeopleVerdicts& verdicts) {
  TextTable table{.header = {"task"}, .rows = {}, .label_columns = 1};
  for (const char* condition : kConditions) table.header.push_back(fmt::format("{} %", condition));
  table.header.insert(table.header.end(), {"all of them %", "others refused %"});
  for (const Task task : all_tasks()) {
    const TaskShares shares = shares_of(verdicts, task);
    std::vector<std::string> row = {std::string(to_string(task))};
    for (const char* condition : kConditions) {
      const auto found = shares.conditions.find(condition);
      row.push_back(found == shares.conditions.end() ? "-" : share_cell(found->second));
    }
    row.push_back(share_cell(shares.all));
    row.push_back(share_cell(shares.refused));
    table.rows.push_back(std::move(row));
  }
  return table;
}

TextTable people_failures_table(const PeopleVerdicts& verdicts) {
  TextTable table{.header = {"clip", "person", "label", "rule", "failed", "measured"}, .rows = {}, .label_columns = 6};
  for (const PersonCheck& person : verdicts.people)
    for (const auto& [task, result] : person.by_task)
      if (result.success != (person.label == to_string(task)))
        table.rows.push_back({excerpt(person.clip), std::string(1, person.person), person.label,
                              std::string(to_string(task)), result.success ? "accepted" : failed_parts(result),
                              measured(result)});
  for (const auto& [clip, message] : verdicts.unread)
    table.rows.push_back({excerpt(clip), "-", "-", "-", "not read", message});
  return table;
}

nlohmann::json people_conditions_json(const PeopleVerdicts& verdicts) {
  nlohmann::json json = {{"people", verdicts.people.size()}, {"still", verdicts.still}, {"unread", verdicts.unread}};
  for (const Task task : all_tasks()) {
    const TaskShares shares = shares_of(verdicts, task);
    nlohmann::json& of = json["tasks"][std::string(to_string(task))];
    for (const auto& [condition, share] : shares.conditions) of["conditions"][condition] = share_json(share);
    of["all"] = share_json(shares.all);
    of["others_refused"] = share_json(shares.refused);
  }
  return json;
}

}  // namespace duet
