// Trace files of ten million frames: read, converted, counted and decoded, each in a process of its own, whose CPU time
// and peak memory count. The files are made here, in the folder for temporary files, and taken away again.
//
//     bench_trace [FRAMES]
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "bench/tools/figures.hpp"
#include "berth/base/random.hpp"
#include "berth/decode/decoder.hpp"
#include "berth/trace/stream.hpp"

using namespace berth;
using trace::Format;

namespace {

constexpr double aim = 1'000'000;  // frames a second
constexpr std::size_t piece = std::size_t{1} << 18U;

// A machine of 20 nodes at work: SYNC, a TPDO and an RPDO each, heartbeats, now and then an SDO transfer or an EMCY.
class Traffic {
 public:
  trace::Entry next() {
    trace::Entry entry;
    at_ += std::chrono::microseconds(80 + random_.below(400));
    entry.at = at_;
    const auto node = static_cast<std::uint32_t>(1 + random_.below(20));
    const auto kind = random_.below(100);
    auto& f = entry.frame;
    std::array<std::uint8_t, 8> data{};
    for (auto& byte : data) byte = static_cast<std::uint8_t>(random_.next());
    if (answer_ != 0) {
      f = can::Frame::base(0x580 + answer_, {0x4B, 0x17, 0x10, 0x00, 0xF4, 0x01, 0, 0});
      answer_ = 0;
    } else if (kind < 4) {
      f = can::Frame::base(0x80, {});
    } else if (kind < 50) {
      f = can::Frame::base(0x180 + node, data);
    } else if (kind < 88) {
      f = can::Frame::base(0x200 + node, data);
    } else if (kind < 95) {
      f = can::Frame::base(0x700 + node, {5});
    } else if (kind < 99) {
      f = can::Frame::base(0x600 + node, {0x40, 0x17, 0x10, 0x00, 0, 0, 0, 0});
      answer_ = node;
    } else {
      f = can::Frame::ext(0x1F90'0135, {});
    }
    return entry;
  }

 private:
  Random random_{1};
  rt::Duration at_ = std::chrono::seconds(1'700'000'000);
  std::uint32_t answer_ = 0;
};

std::shared_ptr<const od::Description> description() {
  using od::Literal;
  od::DescriptionBuilder b;
  b.object(0x2000, od::ObjectCode::array, "Axis");
  for (std::uint8_t sub = 1; sub <= 4; ++sub)
    b.sub(0x2000,
          {.sub = sub, .name = fmt::format("Value {}", sub), .type = od::DataType::integer16, .mappable = true});
  for (const std::uint16_t base : {std::uint16_t{0x1400}, std::uint16_t{0x1800}}) {
    b.object(base, od::ObjectCode::record, "PDO communication");
    b.sub(base, {.sub = 1, .name = "COB-ID", .initial = Literal::node_id_plus(base == 0x1400 ? 0x200 : 0x180)});
    const auto mapping = static_cast<std::uint16_t>(base + 0x200);
    b.object(mapping, od::ObjectCode::array, "PDO mapping");
    b.sub(mapping, {.sub = 0, .type = od::DataType::unsigned8, .initial = Literal::number(4)});
    for (std::uint8_t sub = 1; sub <= 4; ++sub)
      b.sub(mapping, {.sub = sub, .initial = Literal::number(0x2000'0010U | static_cast<std::uint32_t>(sub) << 8)});
  }
  return b.build();
}

struct Measured {
  double cpu = 0;     // s
  double wall = 0;    // s
  double memory = 0;  // MiB at most
  bool ok = false;
};

Measured in_child(const std::function<void()>& work) {
  Measured measured;
  std::fflush(stdout);
  const bench::Watch watch;
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(0);
  }
  int status = 0;
  rusage used{};
  if (child < 0 || ::wait4(child, &status, 0, &used) != child) return measured;
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) / 1e6;
  };
  measured.wall = watch.seconds();
  measured.cpu = seconds(used.ru_utime) + seconds(used.ru_stime);
  measured.memory = static_cast<double>(used.ru_maxrss) / 1024;
  measured.ok = status == 0;
  return measured;
}

class File {
 public:
  File(const std::string& path, const char* mode) : file_(std::fopen(path.c_str(), mode)) {
    if (file_ == nullptr) std::abort();
  }
  ~File() { std::fclose(file_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  std::FILE* get() const noexcept { return file_; }

 private:
  std::FILE* file_;
};

// What a reader gives, into a file.
class Convert : public trace::Sink {
 public:
  Convert(Format to, const std::string& path) : writer_(trace::make_writer(to)), file_(path, "wb") {}
  void entry(const trace::Entry& entry) override {
    writer_->write(entry, "can0", out_);
    if (out_.size() >= piece) flush();
  }
  void finding(Finding finding) override {
    if (finding.severity == Finding::Severity::error) std::abort();
  }
  void done() {
    writer_->finish(out_);
    flush();
  }

 private:
  void flush() {
    if (std::fwrite(out_.data(), 1, out_.size(), file_.get()) != out_.size()) std::abort();
    out_.clear();
  }
  std::unique_ptr<trace::Writer> writer_;
  File file_;
  std::string out_;
};

class Count final : public trace::Sink {
 public:
  void entry(const trace::Entry& entry) override { counter.add(entry); }
  void finding(Finding) override {}
  trace::Counter counter;
};

// Rows as `berth trace` prints them.
class Words final : public trace::Sink, private decode::Rows {
 public:
  explicit Words(const std::string& path)
      : file_(path, "wb"), writer_(trace::make_writer(Format::candump)), decoder_(*this) {
    const auto type = description();
    for (std::uint8_t node = 1; node <= 20; ++node)
      decoder_.know(0, NodeId(node), {.name = fmt::format("axis {}", node), .description = type});
  }
  void entry(const trace::Entry& entry) override { decoder_.entry(entry); }
  void finding(Finding) override {}

 private:
  void row(const decode::Row& row) override {
    writer_->write(*row.entry, "can0", out_);
    out_.back() = ' ';
    out_ += row.words;
    out_ += '\n';
    if (out_.size() < piece) return;
    if (std::fwrite(out_.data(), 1, out_.size(), file_.get()) != out_.size()) std::abort();
    out_.clear();
  }
  File file_;
  std::unique_ptr<trace::Writer> writer_;
  decode::Decoder decoder_;
  std::string out_;
};

void read_all(Format from, const std::string& path, trace::Sink& sink) {
  const File file(path, "rb");
  const auto reader = trace::make_reader(from, path);
  std::vector<char> buffer(piece);
  while (const auto got = std::fread(buffer.data(), 1, buffer.size(), file.get()))
    reader->feed({buffer.data(), got}, sink);
  reader->finish(sink);
}

}  // namespace

int main(int argc, char** argv) {
  const auto frames = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 10'000'000ULL;
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("berth-bench-trace-{}", ::getpid());
  std::filesystem::create_directory(folder);
  const auto path = [&](Format format) { return (folder / fmt::format("run.{}", trace::name(format))).string(); };
  const std::string log = path(Format::candump);
  {
    Convert generated(Format::candump, log);
    Traffic traffic;
    for (std::uint64_t i = 0; i < frames; ++i) generated.entry(traffic.next());
    generated.done();
  }
  std::vector<bench::Figure> figures;
  double memory = 0;
  const auto measure = [&](const std::string& name, double wanted, const std::function<void()>& work) {
    const Measured m = in_child(work);
    memory = std::max(memory, m.memory);
    auto figure = bench::at_least(name, static_cast<double>(frames) / m.cpu, wanted, "frames/s");
    figure.measured += fmt::format(" ({:.2f} s CPU, {:.2f} s wall, {:.1f} MiB)", m.cpu, m.wall, m.memory);
    if (!m.ok) figure.met = false;
    figures.push_back(std::move(figure));
  };
  const auto convert = [&](Format from, Format to) {
    const std::string into = from == to ? (folder / "again.log").string() : path(to);
    measure(fmt::format("{} to {}", trace::name(from), trace::name(to)), aim, [&] {
      Convert sink(to, into);
      read_all(from, path(from), sink);
      sink.done();
    });
  };
  convert(Format::candump, Format::candump);
  for (const Format format : {Format::pcapng, Format::asc, Format::trc}) {
    convert(Format::candump, format);
    convert(format, Format::candump);
    std::filesystem::remove(path(format));
  }
  measure("statistics of a candump log", aim, [&] {
    Count sink;
    read_all(Format::candump, log, sink);
    if (sink.counter.statistics().frames != frames) std::abort();
  });
  measure("candump log in words, 20 described nodes", aim, [&] {
    Words sink("/dev/null");
    read_all(Format::candump, log, sink);
  });
  figures.push_back(bench::at_most("peak memory of any of these", memory, 32, "MiB"));
  std::filesystem::remove_all(folder);
  bench::print_figures(fmt::format("traces of {} frames, by CPU time", bench::grouped(static_cast<double>(frames))),
                       figures);
  return 0;
}
