#include "berth/mqtt/tls_cache.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <utility>

namespace berth::mqtt {

TlsCache::Stamp TlsCache::stamp_of(const std::string& file) noexcept {
  struct stat what {};
  if (file.empty() || ::stat(file.c_str(), &what) != 0) return {};
  return {what.st_ino, what.st_size, what.st_mtim.tv_sec, what.st_mtim.tv_nsec};
}

TlsCache::Stamps TlsCache::stamps_of(const TlsFiles& files) noexcept {
  return {stamp_of(files.authorities), stamp_of(files.certificate), stamp_of(files.key)};
}

tl::expected<std::shared_ptr<Tls>, std::string> TlsCache::get(const TlsFiles& files, const std::string& host) {
  // Before the reading: what changes meanwhile is read again the next time.
  const Stamps stamps = stamps_of(files);
  const auto it =
      std::ranges::find_if(known_, [&](const Known& known) { return known.files == files && known.host == host; });
  if (it != known_.end() && it->stamps == stamps) return it->tls;
  auto loaded = Tls::load(files, host);
  if (!loaded) return loaded;
  if (it != known_.end()) {
    it->stamps = stamps;
    it->tls = *loaded;
  } else {
    known_.push_back({files, host, stamps, *loaded});
  }
  return loaded;
}

}  // namespace berth::mqtt
