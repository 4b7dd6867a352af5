#!/bin/sh
# Make what a release publishes, for `make release`: the handout, the site and the image of a tagged commit.
set -eu
cd "$(dirname "$0")/.."
fail() {
    printf '%s\n' "$*" >&2
    exit 1
}

version=$(sed -n "s/^version = '\(.*\)'/\1/p" pyproject.toml)
[ -z "$(git status --porcelain)" ] || fail 'Some files are not committed: commit them, or put them aside with `git stash --all`.'
sed -n '/^## /{p;q}' CHANGELOG.md | grep -qx "## $version, 20[0-9][0-9]-[0-9][0-9]-[0-9][0-9]" ||
    fail "CHANGELOG.md does not begin with \`## $version, YYYY-MM-DD\`, the version of pyproject.toml: say there what has changed."
[ "$(git tag --points-at HEAD --list "v$version")" ] ||
    fail "This commit has no tag v$version. After \`make test\` has passed: git tag -a v$version -m $version"

make handout
make site
make image
cat << END

Release $version is made. Publish, in this order:
  the tag           git push origin v$version
  handout/*.tar.gz  where your students get the lessons; \`make update\` of theirs reads it, too
  site/             as it is, on any web server or as GitHub Pages: it needs no program of its own
  the image         podman push localhost/ros2_notebooks REGISTRY/ros2_notebooks:$version
A release on GitHub takes its text from CHANGELOG.md.
END
