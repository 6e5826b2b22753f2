#include "record.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "berth/base/private_file.hpp"
#include "berth/operate/report.hpp"
#include "berth/trace/candump.hpp"
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
  if (auto bad = may_write(path, "--record", force)) return tl::unexpected(*std::move(bad));
  log_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, private_mode(path));
  if (log_ >= 0) return {};
  return tl::unexpected(failure(Exit::failed, path + ": " + std::strerror(errno)));
}

void Record::follow(std::function<bool()> wanted, std::function<void(const std::string& line)> take) {
  wanted_ = std::move(wanted);
  take_ = std::move(take);
}

void Record::frame(const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master) {
  const bool followed = wanted_ && wanted_();
  const bool sent = sent_ != nullptr && by_master;
  if (log_ < 0 && !followed && !sent) return;
  const Recorded recorded{operate::seconds(at), bus, can::to_string(frame), by_master};
  if (log_ >= 0 || followed) {
    const std::string line = candump_line(recorded) + '\n';
    if (followed) take_(line);
    if (log_ >= 0) lines_ += line;
  }
  if (sent) sent_->push_back(recorded);
  constexpr std::size_t enough = std::size_t{1} << 16U;
  if (lines_.size() >= enough) write_out();
}

void Record::settle() noexcept {
  constexpr auto often = std::chrono::milliseconds(100);
  if (lines_.empty() || std::chrono::steady_clock::now() - written_ < often) return;
  write_out();
}

bool Record::kept() noexcept {
  write_out();
  return !failed_;
}

// Whole lines or none: what a full disk cut off is taken back.
void Record::write_out() noexcept {
  if (log_ < 0 || lines_.empty()) return;
  written_ = std::chrono::steady_clock::now();
  std::size_t done = 0;
  while (done < lines_.size() && !failed_) {
    const auto n = ::write(log_, lines_.data() + done, lines_.size() - done);
    if (n > 0) {
      done += static_cast<std::size_t>(n);
    } else {
      failed_ = n == 0 || errno != EINTR;
    }
  }
  if (failed_ && done > 0) {
    const auto newline = lines_.rfind('\n', done - 1);
    const std::size_t whole = newline == std::string::npos ? 0 : newline + 1;
    const off_t end = ::lseek(log_, 0, SEEK_CUR) - static_cast<off_t>(done - whole);
    static_cast<void>(::ftruncate(log_, end));
  }
  lines_.clear();
}

}  // namespace berth::cli
