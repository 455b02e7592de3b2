#include "duet/experiment/suite/suite_names.h"

namespace duet {

bool is_path_option(std::string_view option) {
  return option == "network" || option == "language" || option == "library";
}

const NameTable<SuiteStart>& start_names() {
  static const NameTable<SuiteStart> names = {{"auto", SuiteStart::kAuto},
                                              {"clip", SuiteStart::kClip},
                                              {"approach", SuiteStart::kApproach},
                                              {"act", SuiteStart::kAct},
                                              {"sim_to_real", SuiteStart::kSimToReal}};
  return names;
}

const NameTable<Side>& side_names() {
  static const NameTable<Side> names = {{"left", Side::kLeft}, {"right", Side::kRight}};
  return names;
}

const NameTable<ActOutcome>& act_outcome_names() {
  static const NameTable<ActOutcome> names = {
      {"complete", ActOutcome::kComplete}, {"hesitant", ActOutcome::kHesitant}, {"aborted", ActOutcome::kAborted}};
  return names;
}

const NameTable<ClipRoles>& role_names() {
  static const NameTable<ClipRoles> names = {{"own", ClipRoles::kOwn}, {"both", ClipRoles::kBoth}};
  return names;
}

const NameTable<Likeness>& likeness_names() {
  static const NameTable<Likeness> names = {{"rehearsed", Likeness::kRehearsed}, {"people", Likeness::kPeople}};
  return names;
}

const NameTable<PartnerMode>& partner_names() {
  static const NameTable<PartnerMode> names = {
      {"none", PartnerMode::kNone}, {"ghost", PartnerMode::kGhost}, {"solid", PartnerMode::kSolid}};
  return names;
}

const NameTable<RecordTrajectories>& record_names() {
  static const NameTable<RecordTrajectories> names = {{"none", RecordTrajectories::kNone},
                                                      {"failures", RecordTrajectories::kFailures},
                                                      {"all", RecordTrajectories::kAll}};
  return names;
}

const NameTable<DetectorVersion>& version_names() {
  static const NameTable<DetectorVersion> names = {{"robot", DetectorVersion::kRobot},
                                                   {"paper", DetectorVersion::kPaper},
                                                   {"interaction", DetectorVersion::kInteraction}};
  return names;
}

const NameTable<ThresholdSet>& threshold_names() {
  static const NameTable<ThresholdSet> names = {
      {"paper", ThresholdSet::kPaper}, {"strict", ThresholdSet::kStrict}, {"act", ThresholdSet::kAct}};
  return names;
}

std::string_view to_string(SuiteStart start) { return name_of(start_names(), start); }
std::string_view to_string(PartnerMode partner) { return name_of(partner_names(), partner); }

}  // namespace duet
