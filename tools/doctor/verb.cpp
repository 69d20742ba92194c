#include "geoflow/tools/verb.hpp"

#include <memory>
#include <string_view>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "geoflow/drivers/d435i.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"

namespace geoflow::tools {
namespace {

using drivers::D435iFinding;

std::string_view name_of(D435iFinding::Grade grade) {
  switch (grade) {
    case D435iFinding::Grade::kGood:
      return "good";
    case D435iFinding::Grade::kNote:
      return "note";
    case D435iFinding::Grade::kProblem:
      return "problem";
  }
  return "unknown";
}

class DoctorVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "doctor"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Say what a camera lacks on this machine, and how to mend it";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow doctor                                                  link, permissions, "
           "kernel drivers, metadata, IMU\n"
           "The exit code is 1 where there is a problem.";
  }
  void declare(CLI::App& /*command*/) override {}

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    bool problem = false;
    for (const D435iFinding& finding : drivers::diagnose_d435i()) {
      problem = problem || finding.grade == D435iFinding::Grade::kProblem;
      console.object({{"subject", "d435i"},
                      {"grade", name_of(finding.grade)},
                      {"what", finding.what},
                      {"remedy", finding.remedy}});
      console.line("{}: {}", name_of(finding.grade), finding.what);
      if (!finding.remedy.empty()) {
        console.line("    {}", finding.remedy);
      }
    }
    return problem ? ExitCode::kFailure : ExitCode::kOk;
  }
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_doctor_verb() {
  return std::make_unique<DoctorVerb>();
}

}  // namespace geoflow::tools
