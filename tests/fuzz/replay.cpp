// Runs a fuzz target without a fuzzer, with any compiler:
//
//     replay [--mutations N] [--seed N] PATH…   every file, and every file of a folder; then N seeded mutations of them
//
// A property that does not hold ends the program. --write FILE writes each input before its run, so that the last one
// is the one that ended the program.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "bytes.hpp"

namespace {

using Input = std::vector<std::uint8_t>;

Input read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::vector<Input> read_all(const std::vector<std::string>& paths) {
  std::vector<std::filesystem::path> files;
  for (const std::string& path : paths) {
    if (!std::filesystem::is_directory(path)) {
      files.emplace_back(path);
      continue;
    }
    for (const auto& entry : std::filesystem::directory_iterator(path)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());  // the same mutations on every machine
  std::vector<Input> inputs;
  for (const auto& file : files) inputs.push_back(read(file));
  return inputs;
}

class Mutator {
 public:
  Mutator(const std::vector<Input>& corpus, unsigned seed) : corpus_(corpus), engine_(seed) {}

  Input next() {
    Input input = corpus_[below(corpus_.size())];
    for (std::size_t k = 1 + below(8); k > 0; --k) mutate(input);
    if (input.size() > 1 << 16) input.resize(1 << 16);
    return input;
  }

 private:
  std::size_t below(std::size_t n) { return engine_() % n; }
  std::uint8_t byte() { return static_cast<std::uint8_t>(below(256)); }

  void mutate(Input& input) {
    if (input.empty()) {
      input.resize(below(64));
      for (std::uint8_t& b : input) b = byte();
      return;
    }
    const std::size_t at = below(input.size()), rest = input.size() - at;
    const std::size_t length = std::min(rest, 1 + below(below(4) == 0 ? 256 : 8));
    const auto place = [&input](std::size_t i) { return input.begin() + static_cast<std::ptrdiff_t>(i); };
    switch (below(7)) {
      case 0: input[at] = byte(); break;
      case 1: input[at] ^= static_cast<std::uint8_t>(1U << below(8)); break;
      case 2: input.erase(place(at), place(at + length)); break;
      case 3: {
        const Input part(place(at), place(at + length));
        input.insert(place(below(input.size() + 1)), part.begin(), part.end());
        break;
      }
      case 4: {
        const Input& other = corpus_[below(corpus_.size())];
        if (other.empty()) break;
        const std::size_t from = below(other.size());
        const auto first = other.begin() + static_cast<std::ptrdiff_t>(from);
        const auto count = static_cast<std::ptrdiff_t>(std::min(other.size() - from, 1 + below(64)));
        input.insert(place(at), first, first + count);
        break;
      }
      case 5:
        for (std::size_t i = at; i < at + length; ++i) input[i] = byte();
        break;
      default: input.insert(place(at), 1 + below(8), byte());
    }
  }

  const std::vector<Input>& corpus_;
  std::mt19937_64 engine_;
};

}  // namespace

int main(int argc, char** argv) {
  long mutations = 0;
  unsigned seed = 1;
  std::string last;
  std::vector<std::string> paths;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.starts_with("--") && i + 1 == argc) {
      std::fprintf(stderr, "%s needs a value\n", argv[i]);
      return 2;
    }
    if (word == "--mutations") {
      mutations = std::atol(argv[++i]);
    } else if (word == "--seed") {
      seed = static_cast<unsigned>(std::atol(argv[++i]));
    } else if (word == "--write") {
      last = argv[++i];
    } else {
      paths.push_back(word);
    }
  }
  const std::vector<Input> corpus = read_all(paths);
  if (corpus.empty()) {
    std::fprintf(stderr, "no input: replay [--mutations N] [--seed N] [--write FILE] PATH…\n");
    return 2;
  }
  const auto run = [&last](const Input& input) {
    if (!last.empty()) {
      std::ofstream(last, std::ios::binary)
          .write(reinterpret_cast<const char*>(input.data()), static_cast<std::streamsize>(input.size()));
    }
    LLVMFuzzerTestOneInput(input.data(), input.size());
  };
  for (const Input& input : corpus) run(input);
  Mutator mutator(corpus, seed);
  for (long k = 0; k < mutations; ++k) run(mutator.next());
  std::printf("%zu inputs and %ld mutations of them (seed %u): every property holds\n", corpus.size(), mutations, seed);
}
