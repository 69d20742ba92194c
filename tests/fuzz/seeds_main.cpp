#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <random>
#include <span>
#include <vector>

/// Runs a fuzz target without libFuzzer: over nothing, over each seed, over each seed cut short,
/// and over seeds with some bytes changed. It passes by not crashing. Usage: NAME_fuzz
/// [SEEDS_FOLDER]

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kCuts = 200;
constexpr int kMutations = 200;
constexpr std::size_t kRandomBytes = 512;
constexpr unsigned kByteValues = 256;

void run(std::span<const std::uint8_t> input) {
  LLVMFuzzerTestOneInput(input.data(), input.size());
}

void run_mutations(const Bytes& seed, std::mt19937& random) {
  if (seed.empty()) {
    return;
  }
  for (std::size_t i = 0; i < kCuts; ++i) {
    run(std::span{seed}.first(seed.size() * i / kCuts));
  }
  for (int i = 0; i < kMutations; ++i) {
    Bytes input = seed;
    for (unsigned changes = 1 + random() % 8; changes > 0; --changes) {
      input[random() % input.size()] = static_cast<std::uint8_t>(random() % kByteValues);
    }
    run(input);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::mt19937 random;  // NOLINT(bugprone-random-generator-seed): the same inputs in every run
  run({});
  Bytes noise(kRandomBytes);
  for (std::uint8_t& byte : noise) {
    byte = static_cast<std::uint8_t>(random() % kByteValues);
  }
  run_mutations(noise, random);
  int seeds = 0;
  if (argc > 1 && std::filesystem::is_directory(argv[1])) {
    for (const auto& entry : std::filesystem::directory_iterator{argv[1]}) {
      std::ifstream file{entry.path(), std::ios::binary};
      const Bytes seed{std::istreambuf_iterator<char>{file}, {}};
      run(seed);
      run_mutations(seed, random);
      ++seeds;
    }
  }
  std::printf("%d seeds\n", seeds);
  return 0;
}
