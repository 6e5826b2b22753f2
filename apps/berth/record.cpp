#include "record.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "berth/base/private_file.hpp"
#include "berth/operate/report.hpp"
#include "berth/trace/candump.hpp"
#include "berth/trace/stream.hpp"
#include "options.hpp"
#include "outputs.hpp"

namespace berth::cli {

using Json = nlohmann::ordered_json;

std::string candump_line(const Recorded& f) {
  if (!f.at_s) return f.frame;
  return trace::candump_line(rt::Duration(std::llround(*f.at_s * 1e9)), f.bus, f.frame);
}

void print_dry_run(const std::vector<Recorded>& frames, const command::Reply* reply, bool json) {
  if (!json) {
    for (const auto& f : frames) print_line(candump_line(f));
    if (reply != nullptr && !reply->error.empty()) print_errors(reply->error);
    return;
  }
  Json all;
  all["dry_run"] = true;
  all["frames"] = Json::array();
  for (const auto& f : frames) {
    all["frames"].push_back({{"at_s", f.at_s ? Json(*f.at_s) : Json(nullptr)}, {"bus", f.bus}, {"frame", f.frame}});
  }
  if (reply != nullptr) all["reply"] = Json::parse(reply->json);
  print_text(all.dump(2));
}

Record::~Record() {
  write_out();
  if (log_ >= 0) ::close(log_);
}

tl::expected<void, Failure> Record::write_to(const std::string& path, bool force) {
  if (const auto other = trace::format_of_path(path); other && *other != trace::Format::candump) {
    return tl::unexpected(failure(
        Exit::usage, fmt::format("--record {0}: the record is a candump log: name it {1}; `berth trace {1} -o {0}` "
                                 "converts it",
                                 path, std::filesystem::path(path).replace_extension("log").string())));
  }
  if (auto bad = may_write(path, "--record", force)) return tl::unexpected(*std::move(bad));
  path_ = path;
  log_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, private_mode(path));
  if (log_ >= 0) return {};
  return tl::unexpected(failure(Exit::failed, path + ": " + std::strerror(errno)));
}

void Record::follow(std::function<bool()> wanted, std::function<void(const std::string& line)> take) {
  wanted_ = std::move(wanted);
  take_ = std::move(take);
}

void Record::frame(const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master) {
  ++seen_;
  if (frames_) frames_(bus, frame, at, by_master);
  if (more_frames_) more_frames_(bus, frame, at, by_master);
  if (own_ && by_master) own_(bus, frame, at, by_master);
  const bool followed = wanted_ && wanted_();
  const bool sent = sent_ != nullptr && by_master;
  if (log_ < 0 && !followed && !sent) return;
  const Recorded recorded{operate::seconds(at), bus, can::to_string(frame), by_master};
  if (log_ >= 0 || followed) {
    const std::string line = candump_line(recorded) + '\n';
    if (followed) take_(line);
    if (log_ >= 0) add(line);
  }
  if (sent) sent_->push_back(recorded);
}

void Record::add(const std::string& line) {
  constexpr std::size_t enough = std::size_t{1} << 16U;
  constexpr std::size_t most = std::size_t{1} << 20U;
  if (error_ != 0) settle();
  if (lines_.size() + line.size() > most) {
    ++missing_;
    return;
  }
  lines_ += line;
  if (error_ == 0 && lines_.size() >= enough) write_out();
}

void Record::settle() {
  constexpr auto often = std::chrono::milliseconds(100);
  if (lines_.empty() || std::chrono::steady_clock::now() - written_ < often) return;
  write_out();
}

int Record::finish(int status) {
  write_out();
  const auto missing = missing_ + static_cast<std::uint64_t>(std::ranges::count(lines_, '\n'));
  if (missing == 0) return status;
  told_ = true;
  lines_.clear();
  print_error(fmt::format(
      "{}: {} frame{} missing in this record, because the file could not be written for some time{}", path_, missing,
      missing == 1 ? " is" : "s are", error_ == 0 ? std::string() : fmt::format(" ({})", std::strerror(error_))));
  return Exit::failed;
}

// Writes; returns the number of bytes written.
std::size_t Record::put() noexcept {
  error_ = 0;
  std::size_t done = 0;
  while (log_ >= 0 && done < lines_.size() && error_ == 0) {
    const auto n = ::write(log_, lines_.data() + done, lines_.size() - done);
    if (n > 0) {
      done += static_cast<std::size_t>(n);
    } else if (n == 0) {
      error_ = ENOSPC;
    } else if (errno != EINTR) {
      error_ = errno;
    }
  }
  return done;
}

// False: not a regular file; a pipe cannot be shortened.
bool Record::take_back(std::size_t bytes) const noexcept {
  const off_t end = ::lseek(log_, 0, SEEK_CUR) - static_cast<off_t>(bytes);
  return end >= 0 && ::ftruncate(log_, end) == 0 && ::lseek(log_, end, SEEK_SET) == end;
}

// Writes only whole lines: a line that a full disk cut off is removed, and written again when there is room.
void Record::write_out() {
  if (log_ < 0 || lines_.empty()) return;
  written_ = std::chrono::steady_clock::now();
  std::size_t done = put();
  if (done > 0 && done < lines_.size()) {
    const auto newline = lines_.rfind('\n', done - 1);
    const std::size_t whole = newline == std::string::npos ? 0 : newline + 1;
    if (take_back(done - whole)) done = whole;
  }
  lines_.erase(0, done);
  if (error_ != 0) tell_trouble();
}

void Record::tell_trouble() {
  if (std::exchange(told_, true)) return;
  const bool full = error_ == ENOSPC || error_ == EDQUOT || error_ == EFBIG;
  const auto line =
      fmt::format("{}: {}: the record is paused, and frames will be missing in it; {}", path_, std::strerror(error_),
                  full ? "make room there, and it goes on" : "Berth tries again ten times a second");
  if (tell_) {
    tell_(line);
  } else {
    print_error(line);
  }
}

std::string BusTap::words_of(const can::BusError& error) const {
  const auto name_of = [this](int number) {
    if (number == master_) return std::string("Berth");
    for (const auto* const node : bus_->controllers()) {
      if (node->number() == number) return node->name();
    }
    return std::string();
  };
  std::string words;
  if (const auto first = name_of(error.first); !first.empty()) words = "signalled first by " + first;
  if (!words.empty() && error.beside_first > 0)
    words += fmt::format(" and {} other{}", error.beside_first, error.beside_first == 1 ? "" : "s");
  const auto sender = name_of(error.sender);
  if (sender.empty()) return words;
  return fmt::format("{}{}{} sent {:0{}X}h", words, words.empty() ? "" : "; ", sender, error.frame.id,
                     error.frame.extended ? 8 : 3);
}

}  // namespace berth::cli
