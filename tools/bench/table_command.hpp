#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/App.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/console.hpp"

#include "bench/suite/ablation.hpp"
#include "bench/suite/outcome.hpp"
#include "bench/suite/plan.hpp"
#include "bench/suite/sequences.hpp"

namespace geoflow::tools {

/// `geoflow bench table`: a whole data set in the paper's ablation rows. Thread-bound.
class TableCommand {
 public:
  [[nodiscard]] static std::string_view examples();
  void declare(CLI::App& command);
  [[nodiscard]] Result<ExitCode> run(Console& console) const;

 private:
  struct Job;

  [[nodiscard]] Result<AblationRows> chosen_rows() const;
  [[nodiscard]] Result<Job> make_job() const;
  [[nodiscard]] Result<void> find(Job& job) const;
  [[nodiscard]] Result<void> plan_simulated(Job& job) const;
  [[nodiscard]] Result<bool> record_missing(const Job& job, Console& console) const;
  void list(const Job& job, Console& console) const;
  [[nodiscard]] std::size_t at_a_time() const;
  [[nodiscard]] Result<bool> run_all(const Job& job, Console& console) const;
  [[nodiscard]] std::vector<Outcome> judge_all(const Job& job) const;
  [[nodiscard]] Result<void> publish(const Job& job, const std::vector<Outcome>& outcomes,
                                     Console& console) const;

  std::string suite_;
  std::string data_;
  std::string output_;
  std::vector<std::string> rows_;
  std::vector<std::string> settings_;
  std::string seeds_;
  std::vector<std::string> scenes_;
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double duration_s_ = 60;
  std::size_t jobs_ = 0;
  double correct_within_m_ = JudgeOptions{}.correct_within_m;
  bool list_ = false;
  bool collect_ = false;
  bool resume_ = false;
};

}  // namespace geoflow::tools
