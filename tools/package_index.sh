# Where packages come from, for the scripts that source this file: pip's settings, handed on to uv.

# Only what says where packages come from is taken over from the environment. The rest (PIP_USER,
# PIP_TARGET, UV_PYTHON, UV_CONSTRAINT, ...) would change what is installed, or where.
for name in $(env | sed -n 's/^\(PIP_[A-Z_]*\)=.*/\1/p; s/^\(UV_[A-Z_]*\)=.*/\1/p'); do
    case $name in
        *_INDEX | *_INDEX_URL | *_FIND_LINKS | *_INDEX_STRATEGY | UV_INDEX_*) ;;
        *CERT* | *_PROXY | *_TRUSTED_HOST | *_INSECURE_HOST | *_TLS | *_KEYRING_PROVIDER) ;;
        *_CACHE_DIR | *_NO_CACHE | *_CONFIG_FILE | *TIMEOUT | *_RETRIES) ;;
        UV_OFFLINE | UV_LINK_MODE | UV_CONCURRENT_* | PIP_DISABLE_PIP_VERSION_CHECK) ;;
        *) unset "$name" ;;
    esac
done

pip_setting() { # its value, from the environment or a pip.conf; a list is separated by spaces
    for section in :env: install global; do
        value=$(printf '%s\n' "$pip_config" | sed -n "s/^$section\.$1=.\(.*\).\$/\1/p" | sed 's/\\n/ /g')
        [ -z "$value" ] || break
    done
    printf '%s' "$value"
}

uv_reads_pip_settings() { # uv does not read them itself
    pip_config=$(.venv/bin/python -I -m pip config list)
    no_index=
    if [ -z "${UV_DEFAULT_INDEX-}${UV_INDEX_URL-}${UV_INDEX-}${UV_EXTRA_INDEX_URL-}${UV_FIND_LINKS-}" ]; then
        index=$(pip_setting index-url) more=$(pip_setting extra-index-url) links=$(pip_setting find-links)
        [ -z "$index" ] || export UV_DEFAULT_INDEX="$index"
        [ -z "$more" ] || export UV_INDEX="$more"
        [ -z "$links" ] || export UV_FIND_LINKS="$(printf '%s' "$links" | tr -s ' ' ',')"
        case $(pip_setting no-index) in 1 | [Tt]rue | yes | on) no_index=--no-index ;; esac
        # As pip: any of the indexes may have the pinned file. Its hash is checked.
        : "${UV_INDEX_STRATEGY:=unsafe-best-match}"
        export UV_INDEX_STRATEGY
    fi
    certificates=$(pip_setting cert) proxy=$(pip_setting proxy) hosts=$(pip_setting trusted-host)
    [ -z "$certificates" ] || export SSL_CERT_FILE="${SSL_CERT_FILE:-$certificates}"
    [ -z "$proxy" ] || export ALL_PROXY="${ALL_PROXY:-$proxy}"
    [ -z "$hosts" ] || export UV_INSECURE_HOST="${UV_INSECURE_HOST:-$hosts}"
}
