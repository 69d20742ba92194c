#include "geoflow/tools/run.hpp"
#include "geoflow/verbs.hpp"

int main(int argc, char** argv) {
  return geoflow::tools::run_command(GEOFLOW_VERSION, geoflow::tools::make_verbs(), argc, argv);
}
